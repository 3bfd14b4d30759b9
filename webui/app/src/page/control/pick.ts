import type { ConfigKind, ControllerWish } from '../../api/types';
import { words } from '../../text/word';
import type { KindDraft } from './kind_draft';

/** A controller that is to take part in a what-if run. */
export interface Pick extends KindDraft {
  id: number;
  kind: string;
  title: string;
}

/** A name that no other pick has: "PID controller 2". */
export function pickTitle(
  kinds: readonly ConfigKind[],
  kind: string,
  picks: readonly { title: string }[],
): string {
  const plain =
    kinds.find((each) => each.kind === kind)?.title || words(kind.replace(/^controller\./, ''));
  const names = new Set(picks.map(({ title }) => title));
  let title = plain;
  for (let number = 2; names.has(title); number++) title = `${plain} ${number}`;
  return title;
}

export function wishOf({ kind, title, draft }: Pick): ControllerWish {
  return { kind, title, config: draft.value };
}
