/** The whole page by keyboard alone. */

import { downloadFilm, goToFailure } from "./film";
import { status } from "./live/feed";
import { orderAll } from "./live/orders";
import * as state from "./state";

export const KEYS: [string, string][] = [
  ["Space", "play, pause"],
  [", .", "a step back, forward"],
  ["← →", "a hundredth of the view back, forward; with Shift a tenth"],
  ["[ ]", "a day back, forward"],
  ["p n", "previous, next answer, or event of the chosen kind"],
  ["+ −", "zoom in, out"],
  ["0", "the whole run"],
  ["z", "the view before the last zoom"],
  ["l", "filter the lanes"],
  ["?", "these keys"],
  ["< >", "slower, faster"],
  ["Home End", "begin, end"],
  ["1 … 7", "panels"],
  ["g", "go to a time"],
  ["a", "ask the timeline"],
  ["b", "bookmark or note at the moment"],
  ["v", "the next failure"],
  ["m", "a film of the minute around the moment"],
  ["c", "keep who is selected in the middle of the plan"],
  ["f", "search events"],
  ["t", "light, dark"],
];

const DAY_US = 86_400e6;

const ACTIONS: Record<string, (event: KeyboardEvent) => void> = {
  " ": () => {
    if (state.live.value) void orderAll({ action: status.value?.paused ? "resume" : "pause" });
    else state.playing.value = !state.playing.value;
  },
  ",": () => step(-1),
  ".": () => step(1),
  ArrowLeft: (event) => state.goTo(state.moment.value - stride(event)),
  ArrowRight: (event) => state.goTo(state.moment.value + stride(event)),
  "[": () => state.goTo(state.moment.value - DAY_US),
  "]": () => state.goTo(state.moment.value + DAY_US),
  n: () => state.jump(true),
  p: () => state.jump(false),
  "+": () => state.zoom(0.5),
  "=": () => state.zoom(0.5),
  "-": () => state.zoom(2),
  "0": () => state.showRange(state.beginUs.value, state.endUs.value),
  z: () => state.zoomBack(),
  l: () => document.getElementById("filter")?.focus(),
  "?": () => {
    const help = document.querySelector<HTMLDetailsElement>("details.help");
    if (help) help.open = !help.open;
  },
  Escape: () => {
    state.marked.value = null;
    const help = document.querySelector<HTMLDetailsElement>("details.help");
    if (help) help.open = false;
  },
  "<": () => state.faster(-1),
  ">": () => state.faster(1),
  Home: () => state.goTo(state.beginUs.value),
  End: () => state.goTo(state.endUs.value),
  t: () => {
    state.theme.value = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
  },
  b: () => {
    state.panel.value = "notes";
    requestAnimationFrame(() => document.getElementById("note")?.focus());
  },
  c: () => {
    state.followed.value = state.followed.value ? "" : state.selected.value;
  },
  v: () => goToFailure(),
  m: () => {
    if (state.run.value && !state.live.value) void downloadFilm(state.run.value);
  },
  a: () => document.getElementById("ask")?.focus(),
  g: () => document.getElementById("goto")?.focus(),
  f: () => {
    state.panel.value = "events";
    requestAnimationFrame(() => document.getElementById("search")?.focus());
  },
};

function step(by: 1 | -1): void {
  const stepUs = state.run.value?.clock.stepUs ?? 1e6;
  state.goTo((Math.round(state.moment.value / stepUs) + by) * stepUs);
}

function stride(event: KeyboardEvent): number {
  const [from, to] = state.range.value;
  const stepUs = state.run.value?.clock.stepUs ?? 1e6;
  return Math.max(stepUs, Math.round(((to - from) * (event.shiftKey ? 0.1 : 0.01)) / stepUs) * stepUs);
}

export function followKeyboard(): void {
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const at = event.target as HTMLElement;
    if (at.matches("input:not([type=checkbox]):not([type=radio]), select, textarea")) {
      if (event.key === "Escape") at.blur();
      return;
    }
    if (event.key === " " && at.matches("button, a, [role=tab], input")) return;
    if (event.key.startsWith("Arrow") && at.matches("input, [role=tab]")) return;
    const panel = state.PANELS[Number(event.key) - 1];
    const action = ACTIONS[event.key];
    if (!panel && !action) return;
    if (panel) state.panel.value = panel;
    else action!(event);
    if (event.key !== " ") state.follow.value = false;
    event.preventDefault();
  });
}
