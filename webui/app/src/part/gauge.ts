import type { Channel } from '../api/types';
import { fixed, screenUnit } from '../text/unit';
import { words } from '../text/word';

/** How one channel is shown: a row of a table, nothing more. */
export interface GaugeRow {
  key: string;
  title: string;
  help: string;
  /** Unit on the screen where the station names none. */
  displayUnit: string | null;
  decimals: number;
}

const ROWS: readonly GaugeRow[] = [
  row('depth_m', 'Depth', 2, 'Depth of the robot below the surface, by its pressure sensor.'),
  row(
    'position_std_m',
    'Position uncertainty',
    2,
    'Standard deviation of the horizontal position, as the robot estimates it: two thirds of all errors are smaller.',
  ),
  row('heading_rad', 'Heading', 0, 'Direction of the nose, clockwise from north.', 'deg'),
  row('pitch_rad', 'Pitch', 1, 'Nose up is positive.', 'deg'),
  row('roll_rad', 'Roll', 1, 'Right wing down is positive.', 'deg'),
  row('speed_m_s', 'Speed', 3, 'Speed through space, as the robot estimates it.'),
  row('battery_fraction', 'Battery', 0, 'Charge that is left.', '%'),
  row('battery_v', 'Battery voltage', 2, 'Voltage of the battery under its present load.'),
  row('net_buoyancy_kg', 'Net buoyancy', 1, 'Excess mass. Positive sinks, negative rises.', 'g'),
  row(
    'mass_position_m',
    'Mass position',
    1,
    'Position of the movable mass. Forward is positive and turns the nose down.',
    'mm',
  ),
  row('tail_rad', 'Tail', 1, 'Angle of the tail. It turns the robot.', 'deg'),
  row(
    'energy_used',
    'Energy used',
    1,
    'Energy units of the plan’s account since the mission began.',
    'units',
  ),
];

function row(
  key: string,
  title: string,
  decimals: number,
  help: string,
  displayUnit: string | null = null,
): GaugeRow {
  return { key, title, decimals, help, displayUnit };
}

/** Row of a channel; one that the table does not know is shown with what the station says. */
export function gaugeRow(key: string): GaugeRow {
  return (
    ROWS.find((known) => known.key === key) ?? row(key, words(key), 2, 'Measured by the payload.')
  );
}

/** The rows of the channels that a robot reports, known ones first and in the table's order. */
export function gaugeRows(channels: Readonly<Record<string, Channel>>): GaugeRow[] {
  const known = ROWS.filter(({ key }) => key in channels);
  const others = Object.keys(channels).filter((key) => !ROWS.some((each) => each.key === key));
  return [...known, ...others.map(gaugeRow)];
}

export interface Reading {
  text: string;
  unit: string;
}

/** Value of a channel as its gauge shows it. */
export function reading(
  gauge: GaugeRow,
  value: number,
  unit: string,
  displayUnit?: string | null,
): Reading {
  const shown = screenUnit(unit, displayUnit ?? gauge.displayUnit);
  const onScreen = value * shown.factor;
  if (gauge.key === 'heading_rad') {
    const whole = ((Math.round(onScreen) % 360) + 360) % 360;
    return { text: String(whole).padStart(3, '0'), unit: shown.label };
  }
  return { text: fixed(onScreen, decimalsFor(gauge, onScreen)), unit: shown.label };
}

/** Large values need fewer decimals; a well known position is known to millimetres. */
function decimalsFor(gauge: GaugeRow, value: number): number {
  const size = Math.abs(value);
  if (gauge.key === 'position_std_m' && size < 0.1) return gauge.decimals + 1;
  const spare = size >= 1000 ? 2 : size >= 100 ? 1 : 0;
  return Math.max(0, gauge.decimals - spare);
}
