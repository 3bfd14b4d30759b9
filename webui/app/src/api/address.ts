/** Addresses of what a browser loads itself: files, exports and the 3D view. */

export type Query = Record<string, string | number | boolean | null | undefined>;

export function at(robot: string): string {
  return `/api/robots/${encodeURIComponent(robot)}`;
}

export function queryString(query: Query = {}): string {
  const pairs = new URLSearchParams();
  for (const [name, value] of Object.entries(query)) {
    if (value !== null && value !== undefined) pairs.set(name, String(value));
  }
  const text = pairs.toString();
  return text && `?${text}`;
}

/** Address of the station's copy of a log. */
export function logPath(robot: string, id: string): string {
  return `${at(robot)}/logs/${encodeURIComponent(id)}`;
}

/** Address of the raw journal of a robot between two moments, as a file that replay tools read. */
export function journalPath(robot: string, start: string, end: string): string {
  return `/api/journal.tlog${queryString({ robot, start, end })}`;
}
