/** What an energy unit is, for people who meet the word. */
export const ENERGY_HELP =
  'Energy units of the planner: a dive costs 1, a glide or a spiral 1.5, and time. The account of a plan says about how many watt-hours they are.';
