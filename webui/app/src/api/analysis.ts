import type { Client } from 'openapi-fetch';
import { of, told } from './call';
import type { paths } from './generated/station';

type Rows = paths['/api/deployments/{deployment}/analysis/rows']['get']['parameters']['query'];

const LINES = { parseAs: 'stream', headers: { Accept: 'application/x-ndjson' } } as const;

/** Dives and rows of deployments, for figures. */
export class AnalysisApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  dives = (deployment: string) =>
    told(this.#http.GET('/api/deployments/{deployment}/analysis/dives', of({ deployment })));

  /** The same as lines that tell how far the reading is. */
  divesLines = (deployment: string) =>
    told(
      this.#http.GET('/api/deployments/{deployment}/analysis/dives', {
        ...of({ deployment }),
        ...LINES,
      }),
    );
  rowsLines = (deployment: string, query: Rows, signal: AbortSignal) =>
    told(
      this.#http.GET('/api/deployments/{deployment}/analysis/rows', {
        ...of({ deployment }, query, signal),
        ...LINES,
      }),
    );
}

/** Where all rows that a figure is drawn of are fetched from. */
export function rowsCsvPath(deployment: string, query: Readonly<Record<string, string>>): string {
  const asked = new URLSearchParams(query).toString();
  return `/api/deployments/${encodeURIComponent(deployment)}/analysis/rows.csv?${asked}`;
}
