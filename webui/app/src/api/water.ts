import type { Client } from 'openapi-fetch';
import { done, of, told } from './call';
import type { components, paths } from './generated/station';

type Schemas = components['schemas'];

/** Waters, and the charts that lie under their maps. */
export class WaterApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  waters = () => told(this.#http.GET('/api/waters'));
  addWater = (body: Schemas['NewWater']) => told(this.#http.POST('/api/waters', { body }));
  changeWater = (water: string, version: number, body: Schemas['WaterChanges']) =>
    told(
      this.#http.PATCH('/api/waters/{water}', {
        params: { path: { water }, header: { 'if-match': `"${version}"` } },
        body,
      }),
    );
  toldCurrent = (water: string) =>
    told(this.#http.GET('/api/waters/{water}/current', of({ water })));
  tellCurrent = (water: string, body: Schemas['NewTold']) =>
    told(this.#http.PUT('/api/waters/{water}/current', { params: { path: { water } }, body }));
  forgetCurrent = (water: string) =>
    done(this.#http.DELETE('/api/waters/{water}/current', of({ water })));

  readCurrent(water: string, file: File): Promise<{ id: string }> {
    const form = new FormData();
    form.set('file', file);
    const asked = { ...of({ water }), body: { file: file.name }, bodySerializer: () => form };
    return told(this.#http.POST('/api/waters/{water}/current/imports', asked));
  }

  baseMaps = () => told(this.#http.GET('/api/base-maps'));
  removeBaseMap = (base_map: string) =>
    done(this.#http.DELETE('/api/base-maps/{base_map}', of({ base_map })));
}
