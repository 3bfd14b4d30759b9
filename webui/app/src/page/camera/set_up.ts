import type { Camera } from '../../api/types';
import type { Step } from '../../part/step';

const ORDER = ['lens', 'tags', 'pose', 'done'] as const;

/** Lens, Tags, Pose, Check: what is done of a camera's set-up, and what is next. */
export function setUpSteps(camera: Pick<Camera, 'step' | 'lens'>, isChecked = false): Step[] {
  const reached = ORDER.indexOf(camera.step);
  const rung = (title: string, number: number, help: string): Step => ({
    title,
    at: reached > number ? '' : null,
    help,
    isPending: reached === number,
  });
  return [
    rung('Lens', 0, 'The board is shown to the camera, and its lens calibrated.'),
    rung('Tags', 1, 'The station knows where the fixed tags of the tank are.'),
    rung('Pose', 2, 'All cameras are adjusted together: where each hangs and looks.'),
    {
      title: 'Check',
      at: camera.step === 'done' && isChecked ? '' : null,
      help: 'Each fixed tag is left out in turn and found by the cameras alone.',
      isPending: camera.step === 'done' && !isChecked,
    },
  ];
}
