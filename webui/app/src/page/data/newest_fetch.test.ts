import { expect, test } from 'vitest';
import type { LogFile } from '../../api/types';
import { newestFetch } from './newest_fetch';

function log(path: string, job: string | null): LogFile {
  return { id: path, path, bytes: 10, modified_at: null, downloaded: null, job };
}

test('a page that is opened again finds the fetch that was begun last', () => {
  const logs = [log('/a.log', 'job-9'), log('/b.log', 'job-12'), log('/c.log', null)];
  expect(newestFetch(logs)).toEqual({ path: '/b.log', job: 'job-12' });
  expect(newestFetch([log('/c.log', null)])).toBeNull();
});
