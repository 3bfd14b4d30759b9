import type { Prediction } from '../api/types';
import { predictedMark, type PredictedMark } from '../chart/predicted';
import { Fetched } from './fetched.svelte';
import type { Station } from './station.svelte';

/** Predictions of some robots, read again as soon as one falls silent, is heard, or is judged. */
export class PredictionWatch {
  readonly #station: Station;
  readonly #fetched: Fetched<readonly Prediction[]>;
  #ids = $state.raw('');

  /** Of each robot that is not heard, where it should be now. */
  readonly marks = $derived.by((): readonly PredictedMark[] =>
    this.all.flatMap((one) => (one.is_silent ? (predictedMark(one, this.#station.now) ?? []) : [])),
  );

  constructor(station: Station) {
    this.#station = station;
    this.#fetched = new Fetched(() =>
      Promise.all(
        this.#ids
          .split(' ')
          .filter(Boolean)
          .map((id) => station.api.outlook.prediction(id)),
      ),
    );
  }

  get all(): readonly Prediction[] {
    return this.#fetched.value ?? [];
  }

  /** For effects. @param ids Of the robots, parted by a space. */
  follow(ids: string): () => void {
    this.#ids = ids;
    for (const id of ids.split(' ')) void this.#station.revision('prediction', id);
    return this.#fetched.follow(ids);
  }
}
