import type { Deployment } from '../../api/types';
import { dateTime } from '../../text/time';

const STATES: Readonly<Record<Deployment['state'], string>> = {
  planned: 'planned',
  in_water: 'in the water',
  recovered: 'recovered',
  reviewed: 'reviewed',
  delivered: 'delivered',
};

/** How far a deployment has come, in words. */
export function stateWord({ state, kind, void_reason }: Deployment): string {
  if (void_reason) return `void: ${void_reason}`;
  return kind === 'recorded' && state === 'recovered' ? 'recorded' : STATES[state];
}

/** Who looked at the data, and to whom they were handed over; a sentence each. */
export function signaturesOf({ review, delivery }: Deployment): string[] {
  const reviewed = review && `Reviewed by ${review.by} at ${dateTime(review.at)}`;
  const delivered = delivery && `Delivered by ${delivery.by} at ${dateTime(delivery.at)}`;
  return [
    reviewed && `${reviewed}${review.note ? `: ${review.note}` : '.'}`,
    delivered && `${delivered} to ${delivery.note}`,
  ].filter((one): one is string => Boolean(one));
}

/** Whether it is over: what it holds changes no more. */
export function isPast({ ended_at, void_reason }: Deployment): boolean {
  return ended_at !== null && !void_reason;
}

/** From when to when it was, in words; empty while it is planned. */
export function timesOf({ started_at, ended_at }: Deployment): string {
  if (started_at === null) return '';
  return `${dateTime(started_at)} to ${ended_at === null ? 'now, under way' : dateTime(ended_at)}`;
}

/** What for, and who; empty where nobody said. */
export function aimOf({ purpose, people }: Deployment): string {
  return [purpose, people.join(', ')].filter(Boolean).join(' · ');
}

/** Names typed with commas between. */
export function listed(typed: string): string[] {
  return typed
    .split(',')
    .map((one) => one.trim())
    .filter(Boolean);
}

/** Id of the deployment that a section of the Data page shows; `null` for another section. */
export function deploymentOf(section: string): string | null {
  return /^deployment-\d+$/.test(section) ? section : null;
}

/** What a deployment is written as. */
export const EXPORT_FORMATS = [
  { key: 'csv', title: 'CSV' },
  { key: 'geojson', title: 'GeoJSON track' },
  { key: 'geojson&values=true', title: 'GeoJSON samples' },
  { key: 'kml', title: 'KML track' },
  { key: 'kml&values=true', title: 'KML samples' },
  { key: 'actuators', title: 'Actuators' },
] as const;

/** Where a column of an imported file that is no channel is told as CSV. */
export function seriesPath(id: string, series: string): string {
  return `/api/deployments/${encodeURIComponent(id)}/series/${encodeURIComponent(series)}`;
}

export function exportPath(id: string, format: string): string {
  return `/api/deployments/${encodeURIComponent(id)}/export?format=${format}`;
}
