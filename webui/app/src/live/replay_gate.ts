/** What of a page may leave it while it shows the past: nothing that a robot would be sent. */

/**
 * Paths that change nothing in the water: who is signed in, alarms that are seen, the log book,
 * films of the past, and work of the station that is called off.
 */
const HARMLESS = [
  /^\/api\/session$/,
  /^\/api\/alarms\/[^/]+\/acknowledge$/,
  /^\/api\/logbook\//,
  /^\/api\/robots\/[^/]+\/view\/replay\/[^/]+$/,
  /^\/api\/robots\/[^/]+\/films$/,
  /^\/api\/jobs\/[^/]+$/,
];
const COMMAND = /^\/api\/robots\/[^/]+\/commands$/;

/** Whether a request that changes something may be sent: *Surface now* always may. */
export async function mayLeave(request: Request): Promise<boolean> {
  const { pathname } = new URL(request.url);
  if (HARMLESS.some((path) => path.test(pathname))) return true;
  if (!COMMAND.test(pathname)) return false;
  const body = (await request.clone().json()) as { kind?: unknown };
  return body.kind === 'surface';
}
