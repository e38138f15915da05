/** Controls of a running simulation. */

export function LiveControls() {
  return null;
}
