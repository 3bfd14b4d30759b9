import type { LogFile } from '../../api/types';

/** Which of a robot's files was asked for last, running or ended; jobs are counted up. */
export function newestFetch(logs: readonly LogFile[]): { path: string; job: string } | null {
  const [newest] = logs
    .flatMap(({ path, job }) => (job ? [{ path, job }] : []))
    .toSorted((a, b) => numberOf(b.job) - numberOf(a.job));
  return newest ?? null;
}

function numberOf(job: string): number {
  return Number(/\d+$/.exec(job)?.[0] ?? -1);
}
