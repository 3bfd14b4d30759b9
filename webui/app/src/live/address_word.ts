/** Takes a word out of the fragment of the address, where no server and no log ever sees it. */
export function takenFromAddress(name: string): string | null {
  const words = new URLSearchParams(location.hash.slice(1));
  const word = words.get(name);
  if (word !== null) history.replaceState(history.state, '', location.pathname + location.search);
  return word;
}
