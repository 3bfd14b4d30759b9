/** How well located a robot was where it measured, the worst first. */
export const FIDELITIES = [
  { title: 'Low fidelity', help: 'Measured where the robot was poorly located.' },
  { title: 'Middle fidelity', help: 'Measured between a fix and the drift that follows.' },
  { title: 'High fidelity', help: 'Measured soon after a position fix.' },
] as const;
