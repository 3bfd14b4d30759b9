import { noAnswer, Problem } from '../../../api/problem';

type Line<T> = { progress: number } | { answer: T } | { problem: string };

/** The answer at the end of lines that tell how far it is; a refusal among them is thrown. */
export async function answerOf<T>(
  lines: ReadableStream<Uint8Array> | null,
  onprogress: (share: number) => void,
): Promise<T> {
  if (lines === null) throw noAnswer();
  const reader = lines.getReader();
  const decoder = new TextDecoder();
  let rest = '';
  for (;;) {
    const { done, value } = await reader.read();
    rest += decoder.decode(value, { stream: !done });
    const whole = rest.split('\n');
    rest = whole.pop() ?? '';
    for (const text of whole) {
      const line = JSON.parse(text) as Line<T>;
      if ('answer' in line) return line.answer;
      if ('problem' in line) throw new Problem(503, line.problem, '');
      onprogress(line.progress);
    }
    if (done) throw noAnswer();
  }
}
