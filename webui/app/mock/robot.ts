import type { FakePursuit } from './pursuit';
import type { Channel, LiveRobot, Ned, Robot, Site, Track } from '../src/api/types';

export const TANK: Site = {
  name: 'Test tank',
  kind: 'tank',
  water: { x_min_m: -0.925, x_max_m: 3.675, y_min_m: -0.865, y_max_m: 2.235, depth_max_m: 1.2 },
  domain: { x_min_m: 0, x_max_m: 2.75, y_min_m: 0, y_max_m: 1.37, depth_max_m: 0.65 },
  origin_latitude_deg: 42.7251,
  origin_longitude_deg: -84.4791,
  radio_under_water: true,
  variable: 'blue_light',
};

const SHORE_RADII_M = [238, 222, 246, 231, 205, 228, 244, 236, 219, 240, 248, 226];
const SHORE: [number, number][] = SHORE_RADII_M.map((radius, i) => {
  const angle = (i / SHORE_RADII_M.length) * 2 * Math.PI;
  return [250 + radius * Math.cos(angle), 250 + radius * Math.sin(angle)];
});
const SOUNDINGS = Array.from({ length: 11 }, (_, i) => 50 * i);

export const LAKE: Site = {
  name: 'Practice lake',
  kind: 'lake',
  water: { x_min_m: 0, x_max_m: 500, y_min_m: 0, y_max_m: 500, depth_max_m: 20 },
  domain: { x_min_m: 40, x_max_m: 460, y_min_m: 40, y_max_m: 460, depth_max_m: 16 },
  origin_latitude_deg: 42.76,
  origin_longitude_deg: -84.38,
  radio_under_water: false,
  variable: 'chlorophyll',
  shoreline: { name: 'Shore', corners_m: SHORE },
  bathymetry: {
    north_m: SOUNDINGS,
    east_m: SOUNDINGS,
    depth_m: SOUNDINGS.map((n) =>
      SOUNDINGS.map((e) =>
        Math.max(0.5, 20 - 15 * (Math.hypot(n - 250, (e - 250) * 1.1) / 260) ** 2),
      ),
    ),
  },
};

interface Motion {
  ned: Ned;
  heading: number;
  pitch: number;
  speed: number;
  std: number;
  isSurfaced: boolean;
}

/** A robot that yoyos through its site for ever; its motion is a function of time alone. */
export class FakeRobot {
  readonly #dive: number;
  readonly #speed: number;
  mode = 'gliding';
  /** Station time, ms, at which an order to surface was obeyed. */
  surfacedAt: number | null = null;
  /** Target that it follows, or followed last. */
  pursuit: FakePursuit | null = null;
  planId: string | null = null;
  missionId: string | null = null;
  plan: LiveRobot['plan'] = null;
  roundText = '';
  frames = 48_210;

  constructor(
    readonly id: string,
    readonly model: string,
    readonly note: string,
    readonly systemId: number,
    readonly site: Site,
  ) {
    this.#dive = site.kind === 'tank' ? 40 : 360;
    this.#speed = site.kind === 'tank' ? 0.031 : 0.24;
  }

  get isFollowing(): boolean {
    return this.pursuit !== null && this.pursuit.phase !== 'ended';
  }

  motion(nowMs: number): Motion {
    if (this.pursuit && this.isFollowing) {
      const { north, east, heading, speed } = this.pursuit.motion;
      const std = this.site.kind === 'tank' ? 0.03 : 1.2;
      return { ned: [north, east, 0], heading, pitch: 0, speed, std, isSurfaced: true };
    }
    const t = nowMs / 1000;
    const { domain } = this.site;
    const phase = (t % this.#dive) / this.#dive;
    const isSurfaced = phase > 0.86 || this.surfacedAt !== null;
    const share = Math.min(1, phase / 0.86);
    const depth = isSurfaced ? 0.02 : domain.depth_max_m * 0.92 * Math.sin(Math.PI * share);
    const a = t * 0.004 * (this.site.kind === 'tank' ? 6 : 1);
    const wave = (low: number, high: number, p: number) =>
      low + (high - low) * (0.5 + 0.46 * Math.sin(p));
    const north = wave(domain.x_min_m, domain.x_max_m, a * 1.3);
    const east = wave(domain.y_min_m, domain.y_max_m, a + 1.1);
    const heading = Math.atan2(Math.cos(a + 1.1), 1.3 * Math.cos(a * 1.3));
    const pitch = isSurfaced ? 0.02 : -0.45 * Math.cos(Math.PI * share);
    const drift = this.site.kind === 'tank' ? 0.3 : 6;
    const std = isSurfaced ? drift * 0.08 : drift * (0.1 + share * 0.9);
    const speed = isSurfaced ? 0 : this.#speed * (1 + 0.05 * Math.sin(t));
    return { ned: [north, east, depth], heading, pitch, speed, std, isSurfaced };
  }

  isHeard(nowMs: number): boolean {
    return this.site.radio_under_water || this.motion(nowMs).isSurfaced;
  }

  /** When it was heard last, ms. */
  heardAt(nowMs: number): number {
    if (this.isHeard(nowMs)) return nowMs - 200;
    return nowMs - ((nowMs / 1000) % this.#dive) * 1000;
  }

  live(nowMs: number): LiveRobot {
    const at = this.heardAt(nowMs);
    const { ned, heading, pitch, speed, std, isSurfaced } = this.motion(at);
    const age = (nowMs - at) / 1000;
    const channel = (value: number, unit: string, limit = 5, display?: string): Channel => ({
      value,
      unit,
      display_unit: display ?? null,
      measured_at: iso(at),
      received_at: iso(at + 120),
      age_s: age,
      limit_s: limit,
    });
    const isDown = pitch < 0;
    const motion = isSurfaced ? 'At the surface between legs' : `Gliding ${isDown ? 'down' : 'up'}`;
    const mark = this.pursuit?.isBarrierOn === false ? ', teaching: barrier off' : '';
    const isSearching = this.pursuit?.phase === 'lost' && mark === '';
    const following = isSearching ? 'Searching for its target' : `Following its target${mark}`;
    const moving = this.isFollowing ? following : motion;
    const told = this.surfacedAt === null ? moving : 'Holding at the surface';
    const text = this.roundText && this.surfacedAt === null ? `${told}, ${this.roundText}` : told;
    const level = 0.71 - ((nowMs / 1000) % 3600) * 1e-5;
    const variable = this.site.variable === 'blue_light' ? 'counts' : 'ug/L';
    const next = nowMs + (this.#dive * 0.86 - ((nowMs / 1000) % this.#dive)) * 1000;
    return {
      robot: this.id,
      channels: {
        depth_m: channel(ned[2], 'm'),
        pitch_rad: channel(pitch, 'rad', 5, 'deg'),
        roll_rad: channel(0.03 * Math.sin(nowMs / 2000), 'rad', 5, 'deg'),
        heading_rad: channel(heading, 'rad', 5, 'deg'),
        speed_m_s: channel(speed, 'm/s'),
        net_buoyancy_kg: channel(isDown ? 0.0253 : -0.0241, 'kg', 5, 'g'),
        mass_position_m: channel(isDown ? 0.0042 : -0.0038, 'm', 5, 'mm'),
        tail_rad: channel(0.12 * Math.sin(nowMs / 5000), 'rad', 5, 'deg'),
        battery_fraction: channel(level, '', 60, '%'),
        battery_v: channel(11.2 + level, 'V', 60),
        position_std_m: channel(std, 'm'),
        energy_used: channel(((nowMs / 1000) % 900) / 45, '', 60),
        [this.site.variable]: channel(34 + 8 * Math.sin(nowMs / 9000), variable, 120),
      },
      position: {
        ned_m: ned,
        std_m: std,
        latitude_deg: this.site.origin_latitude_deg + ned[0] / 111_080,
        longitude_deg: this.site.origin_longitude_deg + ned[1] / 81_930,
        has_fix: isSurfaced,
        measured_at: iso(at),
        received_at: iso(at + 120),
        age_s: age,
      },
      tracking: this.pursuit?.reports.at(-1) ?? null,
      mode: this.isFollowing
        ? this.pursuit?.phase === 'lost'
          ? 'searching'
          : 'tracking'
        : this.surfacedAt === null
          ? isSurfaced
            ? 'surfaced'
            : 'gliding'
          : 'holding',
      activity: age > 10 ? `Last heard: ${text.charAt(0).toLowerCase()}${text.slice(1)}` : text,
      plan: this.plan,
      link: {
        carrier: 'xbee',
        state: this.isHeard(nowMs) ? 'live' : 'submerged',
        heard_at: iso(at),
        age_s: age,
        rssi_dbm: this.isHeard(nowMs) ? -58 : null,
        frames_received: this.frames,
        frames_bad: 3,
      },
      surface_forecast: this.isHeard(nowMs)
        ? `Reaches ${this.id} now by XBee`
        : `Reaches ${this.id} at its next surfacing, about ${iso(next).slice(11, 16)}Z`,
      next_contact: this.isHeard(nowMs) ? null : { at: iso(next), text: 'Next surfacing' },
      alarm_level: null,
      mission_id: this.missionId,
      plan_id: this.planId,
    };
  }

  robot(nowMs: number): Robot {
    const live = this.live(nowMs);
    return {
      id: this.id,
      name: this.id,
      model: this.model,
      model_key: this.model === 'GRACE 3' ? 'grace3' : 'miniglider',
      model_note: this.note,
      system_id: this.systemId,
      simulated: true,
      kind: 'simulated',
      site: this.site,
      link: live.link,
      mode: live.mode,
      activity: live.activity,
      mission_id: this.missionId,
      plan_id: this.planId,
      next_contact: live.next_contact ?? null,
      surface_forecast: live.surface_forecast ?? '',
      alarm_level: live.alarm_level ?? null,
    };
  }

  track(fromMs: number, toMs: number, points: number): Track {
    const times = Array.from({ length: points }, (_, i) => fromMs + ((toMs - fromMs) * i) / points);
    const motions = times.map((at) => this.motion(at));
    const worst = this.site.kind === 'tank' ? 0.3 : 6;
    return {
      robot: this.id,
      measured_at: times.map(iso),
      north_m: motions.map(({ ned }) => ned[0]),
      east_m: motions.map(({ ned }) => ned[1]),
      depth_m: motions.map(({ ned }) => ned[2]),
      std_m: motions.map(({ std }) => std),
      fidelity: motions.map(({ std }) => (std < worst * 0.35 ? 2 : std < worst * 0.7 ? 1 : 0)),
      adrift: motions.map(() => false),
      latitude_deg: [],
      longitude_deg: [],
    };
  }

  sample(channel: string, atMs: number): number {
    const { ned, pitch, heading, std, speed } = this.motion(atMs);
    if (channel === 'depth_m') return ned[2];
    if (channel === 'pitch_rad') return pitch;
    if (channel === 'heading_rad') return heading;
    if (channel === 'position_std_m') return std;
    if (channel === 'speed_m_s') return speed;
    return 34 + 8 * Math.sin(atMs / 9000);
  }
}

export function iso(ms: number): string {
  return new Date(ms).toISOString();
}
