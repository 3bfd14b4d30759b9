import type { MomentThen, Robot } from '../api/types';
import type { Station } from '../live/station.svelte';
import type { MapRobot } from './site_robots';

const OLD_S = 10;

/** The robots whose position is known, for a drawing of their site. */
export function mapRobots(station: Station, robots: readonly Robot[]): MapRobot[] {
  return robots.flatMap(({ id, name }) => {
    const entry = station.live[id];
    const position = entry?.report?.position;
    if (!position) return [];
    const heading = entry.report?.channels.heading_rad?.value ?? 0;
    const limit = entry.report?.channels.depth_m?.limit_s ?? OLD_S;
    const ageS = station.ageNow(entry, position.age_s);
    return [
      {
        id,
        name,
        ned: position.ned_m,
        stdM: position.std_m ?? 0,
        headingRad: heading,
        isOld: ageS > limit,
      },
    ];
  });
}

/** A robot where it was at the moment of a replay; it never looks alive. */
export function marksThen({ id, name }: Robot, then: MomentThen | null): MapRobot[] {
  if (!then?.position) return [];
  const { ned_m: ned, std_m: std } = then.position;
  const headingRad = then.channels.heading_rad?.value ?? 0;
  return [{ id, name, ned, stdM: std ?? 0, headingRad, isOld: true }];
}
