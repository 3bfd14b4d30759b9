/** One rung of a ladder: something that is proved, under way, or open. */
export interface Step {
  title: string;
  /** Time at which it was proved, `''` where nobody noted it; `null` while it is not. */
  at: string | null;
  help: string;
  detail?: string;
  isFault?: boolean;
  /** Under way, not proved. */
  isPending?: boolean;
}
