import type { Client } from 'openapi-fetch';
import { of, told } from './call';
import type { components, paths } from './generated/station';

type Schemas = components['schemas'];

/** Checklists of robots, and the templates that they are begun from. */
export class ChecklistApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  /** A robot's lists, with what their automatic items find now. */
  ofRobot = (robot: string) =>
    told(this.#http.GET('/api/robots/{robot}/checklists', of({ robot })));

  /** Runs of a robot as they were, the newest first. */
  past = (robot: string) =>
    told(this.#http.GET('/api/robots/{robot}/checklists/past', of({ robot })));

  begin = (robot: string, template: string) =>
    told(
      this.#http.POST('/api/robots/{robot}/checklists', { ...of({ robot }), body: { template } }),
    );

  tick = (checklist: string, body: Schemas['ChecklistTick']) =>
    told(this.#http.POST('/api/checklists/{checklist}/ticks', { ...of({ checklist }), body }));

  complete = (checklist: string) =>
    told(this.#http.POST('/api/checklists/{checklist}/complete', of({ checklist })));

  overrule = (checklist: string, reason: string) =>
    told(
      this.#http.POST('/api/checklists/{checklist}/overrule', {
        ...of({ checklist }),
        body: { reason },
      }),
    );

  /** What automatic items can ask. */
  checks = () => told(this.#http.GET('/api/checklist-checks'));

  templates = () => told(this.#http.GET('/api/checklist-templates'));

  addTemplate = (key: string, template: Schemas['ChecklistTemplate']) =>
    told(this.#http.POST('/api/checklist-templates', { body: { key, template } }));

  /** Save a template as its next version; refused if another was saved meanwhile. */
  changeTemplate = (key: string, template: Schemas['ChecklistTemplate'], version: number) =>
    told(
      this.#http.PUT('/api/checklist-templates/{template}', {
        ...of({ template: key }),
        body: { template, version },
      }),
    );

  /** Let a template be as it was delivered again; put one of the team's own away. */
  resetTemplate = (key: string) =>
    told(this.#http.DELETE('/api/checklist-templates/{template}', of({ template: key })));
}
