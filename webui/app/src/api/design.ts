import type { Client } from 'openapi-fetch';
import { of, told } from './call';
import type { components, DesignInput, paths } from './generated/station';

type Schemas = components['schemas'];

export type DesignSummary = Schemas['DesignSummaryView'];
export type NewDesign = Schemas['NewDesign'];
export type NewTemplate = Schemas['NewTemplate'];
export type Template = Schemas['TemplateView'];
type FileFormat = paths['/api/designs/{design}/file']['get']['parameters']['query']['format'];
/** Where the legs of a comparison come from. */
export type Side = string;

/** Designs: missions as people draw them. Each change names the revision that it was made from. */
export class DesignApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  list = (robot: string, archived: boolean) =>
    told(this.#http.GET('/api/robots/{robot}/designs', of({ robot }, { archived })));

  add = (robot: string, body: NewDesign) =>
    told(
      this.#http.POST('/api/robots/{robot}/designs', {
        ...of({ robot }),
        body,
      }),
    );

  get = (design: string) => told(this.#http.GET('/api/designs/{design}', of({ design })));

  change = (design: string, body: Schemas['Renaming']) =>
    told(this.#http.PATCH('/api/designs/{design}', { ...of({ design }), body }));

  put = (design: string, revision: number, document: DesignInput, what: string) =>
    told(
      this.#http.PUT('/api/designs/{design}/document', {
        ...from(design, revision),
        body: { document: document, what },
      }),
    );

  undo = (design: string, revision: number, key: string) =>
    told(
      this.#http.POST('/api/designs/{design}/undo', { ...from(design, revision), ...once(key) }),
    );

  redo = (design: string, revision: number, key: string) =>
    told(
      this.#http.POST('/api/designs/{design}/redo', { ...from(design, revision), ...once(key) }),
    );

  saveVersion = (design: string, revision: number, comment: string, key: string) =>
    told(
      this.#http.POST('/api/designs/{design}/versions', {
        ...from(design, revision),
        ...once(key),
        body: { comment },
      }),
    );

  version = (design: string, number: number) =>
    told(this.#http.GET('/api/designs/{design}/versions/{number}', of({ design, number })));

  restore = (design: string, revision: number, version: number, key: string) =>
    told(
      this.#http.POST('/api/designs/{design}/restore', {
        ...from(design, revision),
        ...once(key),
        body: { version },
      }),
    );

  /** Lay a document out; nothing is kept. */
  check = (robot: string, document: DesignInput) =>
    told(
      this.#http.POST('/api/robots/{robot}/designs/check', {
        ...of({ robot }),
        body: { document: document },
      }),
    );

  difference = (design: string, first: Side, second: Side) =>
    told(this.#http.GET('/api/designs/{design}/difference', of({ design }, { first, second })));

  /** What the station has (first) beside a document that it does not have (second). */
  differenceWith = (design: string, document: DesignInput) =>
    told(
      this.#http.POST('/api/designs/{design}/difference', {
        ...of({ design }),
        body: { document: document },
      }),
    );

  /** Make a plan of a version, or of what is drawn now; it is flown ahead, and nothing is sent. */
  plan = (design: string, version: number | null = null) =>
    told(
      this.#http.POST('/api/designs/{design}/plan', {
        ...of({ design }),
        body: { version },
      }),
    );

  /** What a format does not express of a design. */
  losses = (design: string, format: FileFormat, version: number | null) =>
    told(
      this.#http.GET(
        '/api/designs/{design}/file/losses',
        of({ design }, { format, ...(version !== null && { version }) }),
      ),
    );

  templates = () => told(this.#http.GET('/api/design-templates'));

  addTemplate = (body: NewTemplate) => told(this.#http.POST('/api/design-templates', { body }));

  removeTemplate = (template: string) =>
    told(this.#http.DELETE('/api/design-templates/{template}', of({ template })));
}

function from(design: string, revision: number) {
  return { params: { path: { design }, header: { 'if-match': `"${revision}"` } } };
}

/** What is asked again under the same key acts once. */
function once(key: string) {
  return { headers: { 'Idempotency-Key': key } };
}
