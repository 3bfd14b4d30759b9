import { readFileSync } from 'node:fs';
import { describe, expect, test } from 'vitest';
import type { Health } from '../api/types';
import { convergence, northEast, wgs84 } from './frame';
import { latitude, longitude } from './position';
import { age, clockTime, countdown, dateTime, duration, parseUtc, typedUtc } from './time';
import {
  bytes,
  compact,
  energy,
  factorText,
  fixed,
  plainNumber,
  screenUnit,
  wattHours,
} from './unit';
import {
  datedActivity,
  healthSentence,
  lastKnown,
  lower,
  overText,
  planName,
  readable,
  words,
} from './word';

describe('times', () => {
  test('are UTC with a Z', () => {
    expect(dateTime('2026-11-21T04:23:48.9Z')).toBe('2026-11-21 04:23:48Z');
    expect(clockTime('2026-11-21T04:23:48+02:00', false)).toBe('02:23Z');
    expect(dateTime(null)).toBe('–');
    expect(clockTime('no time')).toBe('–');
  });

  test('of an age move in whole steps and are never blank', () => {
    expect(age(0.4)).toBe('<1 s ago');
    expect(age(59.9)).toBe('59 s ago');
    expect(age(725)).toBe('12 min ago');
    expect(age(7300)).toBe('2 h ago');
    expect(age(200_000)).toBe('2 d ago');
    expect(age(100 * 86400)).toBe('3 months ago');
    expect(age(2677 * 86400)).toBe('7 years ago');
    expect(age(0.4, 'before the cursor')).toBe('<1 s before the cursor');
    expect(age(null)).toBe('never heard');
  });

  test('of a duration never show sixty of anything', () => {
    expect(duration(59.6)).toBe('1 min 00 s');
    expect(duration(3599.7)).toBe('1 h 00 min');
    expect(duration(7199)).toBe('2 h 00 min');
    expect(duration(undefined)).toBe('–');
  });

  test('to an event that is late say how late', () => {
    expect(countdown(130)).toBe('in 2 min 10 s');
    expect(countdown(-61)).toBe('overdue by 1 min 01 s');
  });
});

/** Drawn with GeographicLib, against which `tests/autonomy/test_frames.py` holds this file. */
const PAIRS = JSON.parse(readFileSync('../../tests/data/geodesic_pairs.json', 'utf8')) as {
  origin: [number, number];
  north_east_m: [number, number];
  wgs84: [number, number];
  frame_heading_deg: number;
  heading_deg: number;
}[];

function degreesApart(one: number, other: number): number {
  return ((((one - other + 180) % 360) + 360) % 360) - 180;
}

describe('positions', () => {
  test('are written in all three notations', () => {
    expect(latitude(42.7251, 'degrees')).toBe('42.72510° N');
    expect(longitude(-84.4791, 'minutes')).toBe('084° 28.746′ W');
    expect(latitude(-42.7251, 'seconds')).toBe('42° 43′ 30.4″ S');
  });

  test('never show sixty minutes or seconds', () => {
    expect(latitude(41.999_999_99, 'minutes')).toBe('42° 00.000′ N');
    expect(latitude(41.999_999_99, 'seconds')).toBe('42° 00′ 00.0″ N');
  });

  test('near a site follow the ellipsoid', () => {
    const site = { origin_latitude_deg: 42.76, origin_longitude_deg: -84.38 };
    const place = wgs84(site, 500, -500);
    expect(place.latitude).toBeCloseTo(42.76 + 500 / 111_081, 6);
    expect(place.longitude).toBeCloseTo(-84.38 - 500 / 81_870, 5);
    expect(northEast(site, 42.76, -84.38)).toEqual([0, 0]);
  });

  test('and headings up to 50 km from it are those of geodesics', () => {
    for (const pair of PAIRS) {
      const [latitude, longitude] = pair.origin;
      const site = { origin_latitude_deg: latitude, origin_longitude_deg: longitude };
      const [north, east] = pair.north_east_m;
      const place = wgs84(site, north, east);
      expect(place.latitude).toBeCloseTo(pair.wgs84[0], 8);
      expect(Math.abs(degreesApart(place.longitude, pair.wgs84[1]))).toBeLessThan(5e-9);
      const back = northEast(site, ...pair.wgs84);
      expect(Math.hypot(back[0] - north, back[1] - east)).toBeLessThan(0.001);
      const heading = pair.frame_heading_deg + (convergence(site, north, east) * 180) / Math.PI;
      expect(Math.abs(degreesApart(heading, pair.heading_deg))).toBeLessThan(0.01);
    }
  });
});

describe('numbers', () => {
  test('are shown in the display unit, and in their own where the pair is unknown', () => {
    expect(screenUnit('rad', 'deg')).toEqual({ label: '°', factor: 180 / Math.PI });
    expect(screenUnit('', '%').factor).toBe(100);
    expect(screenUnit('m', 'furlong')).toEqual({ label: 'm', factor: 1 });
  });

  test('carry readable units', () => {
    expect(screenUnit('m^2/s^3').label).toBe('m²/s³');
    expect(screenUnit('1/s2').label).toBe('1/s²');
    expect(screenUnit('kg/(m s)').label).toBe('kg/(m·s)');
    expect(screenUnit('m/s^0.5').label).toBe('m/√s');
    expect(screenUnit('ug/L').label).toBe('µg/L');
    expect(screenUnit('umol m-2 s-1').label).toBe('µmol·m⁻²·s⁻¹');
    expect(screenUnit('1e-9').label).toBe('ppb');
  });

  test('lose float noise when they are typed', () => {
    expect(plainNumber(0.1 + 0.2)).toBe('0.3');
    expect(plainNumber((25.2 * Math.PI) / 180 / (Math.PI / 180))).toBe('25.2');
    expect(plainNumber(1e-7)).toBe('1e-7');
    expect(plainNumber(90_000)).toBe('90000');
  });

  test('have a minus sign of full width and no negative zero', () => {
    expect(fixed(-1.234, 1)).toBe('−1.2');
    expect(fixed(-0.001, 2)).toBe('0.00');
  });

  test('keep about three digits', () => {
    expect(compact(1234.5)).toBe('1235');
    expect(compact(0.020_71)).toBe('0.0207');
    expect(compact(null)).toBe('–');
    expect(compact(0.000_001_2)).toBe('1.20e−6');
  });

  test('of bytes change to kilobytes late', () => {
    expect(bytes(412)).toBe('412 B');
    expect(bytes(12_340)).toBe('12.3 kB');
  });
});

test('a silent station is not quoted twice', () => {
  expect(lastKnown('Gliding down')).toBe('Last known: gliding down');
  expect(lastKnown('Last heard: gliding down')).toBe('Last heard: gliding down');
  expect(lower('PID controller')).toBe('PID controller');
});

test('ids become names', () => {
  expect(planName('plan-14')).toBe('plan 14');
  expect(planName('foreign')).toBe('foreign');
  expect(words('on_board')).toBe('On board');
});

test.each([
  [0.0005, '0'],
  [1.5, '1.5'],
  [9.96, '10.0'],
  [20, '20'],
  [14.25, '14.3'],
])('energy %s is written %s', (units, text) => {
  expect(energy(units)).toBe(text);
});

describe('a station with a fault', () => {
  const storage = { ok: true, message: '' } as Health['storage'];
  const said = (reasons: string[]) => healthSentence({ storage, reasons });

  test('says which', () => {
    expect(said(['Only 312 MB are free where the data folder is.'])).toBe(
      'Station fault: Only 312 MB are free where the data folder is.',
    );
    expect(said(['One.', 'Two.'])).toBe('Station fault: One. Two.');
  });

  test('without one says nothing', () => {
    expect(said([])).toBeNull();
  });
});

describe('an alarm that is over', () => {
  test('says how it ended and when, in one line', () => {
    expect(overText('mini-1 lost its target; found again.', '28 s ago')).toBe(
      'mini-1 lost its target; found again 28 s ago',
    );
    expect(overText('The port cannot be opened; plug it in.', '2 min ago')).toBe(
      'The port cannot be opened; plug it in; back to normal 2 min ago',
    );
  });
});

describe('plans and missions in sentences of the station', () => {
  test('are named as everywhere else', () => {
    expect(readable('Round 1 of mini-1 is plan-1.')).toBe('Round 1 of mini-1 is plan 1.');
    expect(readable('plan-1 is ready to be sent.')).toBe('Plan 1 is ready to be sent.');
    expect(readable('It began. mission-2 goes on.')).toBe('It began. Mission 2 goes on.');
    expect(readable('mini-1 came up.')).toBe('mini-1 came up.');
    expect(readable('Plan-12 replaces plan-11; mission-3 goes on.')).toBe(
      'Plan 12 replaces plan 11; mission 3 goes on.',
    );
    expect(readable('see /api/plans/plan-1')).toBe('see /api/plans/plan-1');
  });
});

test('energy units are told in watt-hours, too, where that is known', () => {
  expect(wattHours(0.404)).toBe('about 0.40 Wh');
  expect(wattHours(null)).toBe('');
});

test('an old report is told with its age, beside a link that may be live', () => {
  const old = 'Last heard: idle at the surface';
  expect(datedActivity(old, '2 min ago')).toBe('Idle at the surface, as it said 2 min ago');
  expect(datedActivity('Gliding down', '2 min ago')).toBe('Gliding down');
});

test('a deviation of a logarithm is told as a factor', () => {
  expect(factorText(0)).toBe('×1.00');
  expect(factorText(Math.log(2))).toBe('×2.00');
});

describe('a moment that is typed', () => {
  const NOW = Date.parse('2026-11-21T14:31:10Z');

  test('is UTC in every notation of it', () => {
    const at = Date.parse('2026-11-22T04:05:00Z');
    for (const text of ['2026-11-22 04:05', '2026-11-22T04:05:00Z', ' 2026-11-22  4:05z ']) {
      expect(parseUtc(text, NOW)).toBe(at);
    }
    expect(parseUtc(typedUtc(at + 7000), NOW)).toBe(at + 7000);
    expect(typedUtc(at)).toBe('2026-11-22 04:05');
  });

  test('is the next one where no day is said', () => {
    expect(parseUtc('14:32', NOW)).toBe(Date.parse('2026-11-21T14:32:00Z'));
    expect(parseUtc('14:31', NOW)).toBe(Date.parse('2026-11-22T14:31:00Z'));
    expect(parseUtc('14:31', NOW, true)).toBe(Date.parse('2026-11-21T14:31:00Z'));
  });

  test('is none where there is no such moment', () => {
    for (const text of ['', '2026-11-22', '24:00', '2026-02-30 10:00', '11/22/2026 4:05 PM']) {
      expect(parseUtc(text, NOW)).toBeNull();
    }
  });
});
