import { Problem, sentence } from '../api/problem';

/** What a person asks of the station: whether it is under way, and why it was refused. */
export class Attempt {
  /** Why the last one was refused; empty where it was not. */
  refusal = $state.raw('');
  isRunning = $state.raw(false);

  /** Do it; tells whether it was done. A refusal of the station is handed on as well. */
  async run(
    action: () => Promise<unknown>,
    onrefused?: (problem: Problem) => void,
  ): Promise<boolean> {
    this.refusal = '';
    this.isRunning = true;
    try {
      await action();
      return true;
    } catch (error) {
      this.refusal = sentence(error);
      if (error instanceof Problem) onrefused?.(error);
      return false;
    } finally {
      this.isRunning = false;
    }
  }
}
