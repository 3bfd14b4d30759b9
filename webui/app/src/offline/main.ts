/** The page that opens while the station cannot be reached; it shows nothing of robots. */

import { LastContact } from '../live/last_contact';
import { Preference } from '../live/preference.svelte';
import { clockTime, dateTime } from '../text/time';
import '../style/token.css';
import '../style/base.css';
import '../style/control.css';
import './offline.css';

const AGAIN_MS = 10_000;

new Preference(); // wears the theme that was chosen

function say(id: string, text: string): void {
  const place = document.getElementById(id);
  if (place) place.textContent = text;
}

async function ask(): Promise<void> {
  say('asked', 'The station is asked…');
  try {
    const answer = await fetch('/mark.svg', { cache: 'no-store' });
    if (answer.ok) {
      location.reload();
      return;
    }
  } catch {
    // The sentence below says it.
  }
  say('asked', `Asked at ${clockTime(Date.now())} in vain; asked again every 10 s.`);
  setTimeout(() => void ask(), AGAIN_MS);
}

const at = LastContact.kept();
if (at !== null) say('title', `No contact with the station since ${dateTime(at)}`);
say(
  'since',
  at === null
    ? 'When this browser last heard the station is not known.'
    : 'Then this browser last heard the station, by the clock of this device.',
);
setTimeout(() => void ask(), AGAIN_MS);
document.getElementById('again')?.addEventListener('click', () => {
  location.reload();
});
