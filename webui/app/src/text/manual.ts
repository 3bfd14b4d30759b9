/** Address of a section of the manual, which the station serves; `chapter` or `chapter#section`. */
export function manualPath(section: string): string {
  return section ? `/help/${section}` : '/help';
}
