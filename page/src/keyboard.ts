/** The whole page by keyboard alone. */

import { ACTIONS, keyText } from "./actions";
import * as state from "./state";

/** Keys and what they do, for the help; those of actions are in their table. */
export const KEYS: readonly (readonly [string, string])[] = [
  ["Ctrl K", "ask, go to, or do anything"],
  ["← →", "a hundredth of the view back, forward; with Shift a tenth"],
  ...ACTIONS.filter(({ key }) => key).map(({ key, title }) => [keyText(key), title] as const),
];

const actionOfKey = new Map(ACTIONS.filter(({ key }) => key).map((action) => [action.key, action]));

const OTHERS: Record<string, (event: KeyboardEvent) => void> = {
  ArrowLeft: (event) => state.goTo(state.moment.value - stride(event)),
  ArrowRight: (event) => state.goTo(state.moment.value + stride(event)),
  "=": () => state.zoom(0.5),
  Escape: () => {
    state.marked.value = null;
    const help = document.querySelector<HTMLDetailsElement>("details.help");
    if (help) help.open = false;
  },
};

function stride(event: KeyboardEvent): number {
  const [from, to] = state.range.value;
  const stepUs = state.run.value?.clock.stepUs ?? 1e6;
  return Math.max(stepUs, Math.round(((to - from) * (event.shiftKey ? 0.1 : 0.01)) / stepUs) * stepUs);
}

export function followKeyboard(): void {
  addEventListener("keydown", (event) => {
    if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "k") {
      document.getElementById("ask")?.focus();
      event.preventDefault();
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const at = event.target as HTMLElement;
    if (at.matches("input:not([type=checkbox]):not([type=radio]), select, textarea")) {
      if (event.key === "Escape") at.blur();
      return;
    }
    if (event.key === " " && at.matches("button, a, [role=tab], input, summary")) return;
    if (event.key.startsWith("Arrow") && at.matches("input, [role=tab]")) return;
    const action = actionOfKey.get(event.key);
    const other = OTHERS[event.key];
    if (!action && !other) return;
    if (other) other(event);
    else if (action!.isPossible?.() ?? true) action!.run();
    if (event.key !== " ") state.follow.value = false;
    event.preventDefault();
  });
}
