import type { Samples, Track } from '../../api/types';
import type { Cut, Spot } from '../../chart/slice';

type Place = Pick<Spot, 'across' | 'down'>;
type Slicer = (north: number, east: number, depth: number) => Place | null;

/** Bring points into a slice's own axes; `null` for those that belong to another slice. */
export function slicer(positions: readonly number[], cut: Cut, index: number): Slicer {
  const first = positions[0] ?? 0;
  const last = positions.at(-1) ?? 0;
  // Half the distance between slices: what lies nearer belongs to this one.
  const reach =
    positions.length > 1 ? Math.abs(last - first) / (positions.length - 1) / 2 : Infinity;
  const at = positions[index] ?? 0;
  return (north, east, depth) => {
    const [away, across, down] =
      cut === 'depth'
        ? [depth, east, north]
        : cut === 'north'
          ? [north, east, depth]
          : [east, north, depth];
    return Math.abs(away - at) > reach + 1e-9 ? null : { across, down };
  };
}

/** The samples of one slice, the poorly located first so that the well located lie on top. */
export function spotsOf(samples: Samples, toSlice: Slicer): Spot[] {
  const { north_m, east_m, depth_m, smoothed } = samples;
  const found: Spot[] = [];
  samples.fidelity?.forEach((level, i) => {
    const [north, east, depth] = [north_m?.[i] ?? NaN, east_m?.[i] ?? NaN, depth_m?.[i] ?? NaN];
    if (level === null || !Number.isFinite(north + east + depth)) return;
    const place = toSlice(north, east, depth);
    if (place) found.push({ ...place, level, isSmoothed: smoothed?.[i] ?? false });
  });
  return found.toSorted((a, b) => (a.level ?? 0) - (b.level ?? 0));
}

/** The track in the shape of samples, for a station that does not place its samples. */
export function samplesOfTrack(track: Track, channel: string): Samples {
  const { robot, measured_at, north_m, east_m, depth_m, fidelity } = track;
  const isFlown = (i: number) => track.adrift[i] !== true;
  return {
    robot,
    channel,
    unit: '',
    measured_at,
    value: [],
    decimated: false,
    pruned: [],
    is_derived: false,
    north_m,
    east_m,
    depth_m,
    fidelity: fidelity.map((level, i) => (isFlown(i) ? level : null)),
  };
}
