import type { Contact } from '../api/types';
import { countdown } from '../text/time';

/** What the strip says of a contact window that is open; empty where nobody told when it closes. */
export function contactText(contact: Contact | null, now: number): string {
  if (contact?.state !== 'open' || !contact.closes) return '';
  const leftS = (Date.parse(contact.closes.at) - now) / 1000;
  if (leftS >= 0) return `dives ${countdown(leftS)}`;
  const latestS = contact.latest ? (Date.parse(contact.latest.at) - now) / 1000 : 0;
  return latestS > 0 ? `dives any moment, ${countdown(latestS)} at the latest` : 'dives any moment';
}
