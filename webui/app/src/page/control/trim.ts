import type { TrimAdvice, TrimOffsets } from '../../api/types';
import { fixed } from '../../text/unit';

const DEGREES = 180 / Math.PI;

/** "+1.2 g": an offset is a change, so it has a sign. */
export function grams(kilograms: number): string {
  return signed(kilograms * 1000, 'g');
}

export function millimetres(metres: number): string {
  return signed(metres * 1000, 'mm', 1);
}

/** "+0.70 ± 0.03 g": as many decimals as the deviation needs to be told. */
function withDeviation(value: number, deviation: number | null, unit: string): string {
  if (deviation === null) return signed(value, unit);
  const decimals = deviation < 0.05 ? 2 : 1;
  return `${signed(value, '', decimals).trim()} ± ${fixed(deviation, decimals)} ${unit}`;
}

function inThousandths(value: number | null): number | null {
  return value === null ? null : value * 1000;
}

function signed(value: number, unit: string, decimals = 2): string {
  const text = fixed(value, decimals);
  return `${value > 0 && Number(text) !== 0 ? '+' : ''}${text} ${unit}`;
}

export function offsetsText(offsets: TrimOffsets): string {
  return `${grams(offsets.net_buoyancy_offset_kg)}, ${millimetres(offsets.mass_position_offset_m)}`;
}

/** A row of the advice: now, proposed, and how sure the proposal is. */
export interface AdviceRow {
  title: string;
  help: string;
  now: string;
  proposed: string;
}

export function adviceRows(
  advice: Omit<TrimAdvice, 'deployment' | 'vehicle' | 'identification'>,
  now: TrimOffsets,
): AdviceRow[] {
  const { rmse_now: before, rmse_proposed: after } = advice;
  const speed = (value: number | undefined) =>
    value === undefined ? '–' : `${fixed(value * 1000, 1)} mm/s`;
  const angle = (value: number | undefined) =>
    value === undefined ? '–' : `${fixed(value * DEGREES, 2)} °`;
  return [
    {
      title: 'Net buoyancy offset',
      help: 'Added to every net buoyancy that the robot is asked for; the ± is one standard deviation.',
      now: grams(now.net_buoyancy_offset_kg),
      proposed: withDeviation(
        advice.net_buoyancy_offset_kg * 1000,
        inThousandths(advice.net_buoyancy_std_kg),
        'g',
      ),
    },
    {
      title: 'Mass position offset',
      help: 'Added to every mass position that the robot is asked for; the ± is one standard deviation.',
      now: millimetres(now.mass_position_offset_m),
      proposed: withDeviation(
        advice.mass_position_offset_m * 1000,
        inThousandths(advice.mass_position_std_m),
        'mm',
      ),
    },
    {
      title: 'Error of depth rate, RMSE',
      help: 'Model against measurement in steady glides of these dives.',
      now: speed(before?.depth_rate_m_s),
      proposed: speed(after?.depth_rate_m_s),
    },
    {
      title: 'Error of pitch, RMSE',
      help: 'Model against measurement in steady glides of these dives.',
      now: angle(before?.pitch_rad),
      proposed: angle(after?.pitch_rad),
    },
  ];
}

/** Offsets of a stored trim; what it does not tell is 0. */
export function offsetsOf(value: Readonly<Record<string, unknown>>): TrimOffsets {
  const number = (key: string) => (typeof value[key] === 'number' ? value[key] : 0);
  return {
    net_buoyancy_offset_kg: number('net_buoyancy_offset_kg'),
    mass_position_offset_m: number('mass_position_offset_m'),
  };
}
