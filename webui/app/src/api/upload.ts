import { noAnswer, problemOf } from './problem';

/** A file and the fields beside it, on their way to the station. */
export interface Upload {
  path: string;
  form: FormData;
  csrf: string;
  /** Told the part that has left, 0 .. 1. */
  onprogress?: ((share: number) => void) | undefined;
  signal?: AbortSignal | undefined;
}

/** Send a form with a file; unlike `fetch` it can tell how far it is. Refusals are Problems. */
export function upload<T = unknown>({ path, form, csrf, onprogress, signal }: Upload): Promise<T> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open('POST', path);
    request.setRequestHeader('Accept', 'application/json');
    request.setRequestHeader('X-CSRF-Token', csrf);
    request.upload.onprogress = ({ loaded, total }) => onprogress?.(total > 0 ? loaded / total : 0);
    request.onerror = () => reject(noAnswer());
    request.onabort = () => reject(new Error('Cancelled; nothing was kept.'));
    request.onload = () => {
      if (request.status >= 200 && request.status < 300) {
        resolve(JSON.parse(request.responseText) as T);
        return;
      }
      const { status, responseText } = request;
      void problemOf(new Response(responseText, { status })).then(reject);
    };
    signal?.addEventListener('abort', () => request.abort());
    request.send(form);
  });
}
