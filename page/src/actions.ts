/** Everything that can be done on the page: by a key, by the palette, by buttons. */

import { copyLink } from "./address";
import { downloadFilm, goToFailure } from "./film";
import { status } from "./live/feed";
import { branchHere, orderAll } from "./live/orders";
import { playReel } from "./player";
import { saveClip, savePicture } from "./share";
import * as state from "./state";
import { dark } from "./theme";

export interface Action {
  title: string;
  /** As `KeyboardEvent.key` has it; empty: no key does it. */
  key: string;
  run: () => void;
  /** Whether it can be done now; left out: always. */
  isPossible?: () => boolean;
}

const isStored = (): boolean => !state.live.value;
const isServed = (): boolean => state.run.value!.path !== "" && !state.live.value;

/** Show a panel, and put the cursor into a field of it. */
function focusIn(panel: state.Panel, field: string): void {
  state.panel.value = panel;
  requestAnimationFrame(() => document.getElementById(field)?.focus());
}

function step(by: 1 | -1): void {
  const { stepUs } = state.run.value!.clock;
  state.goTo((Math.round(state.moment.value / stepUs) + by) * stepUs);
}

export function showDay(): void {
  state.showRange(...state.run.value!.clock.dayOf(state.moment.value));
}

function goDays(by: 1 | -1): void {
  state.goTo(state.run.value!.clock.daysLater(state.moment.value, by));
}

function toggleHelp(): void {
  const help = document.querySelector<HTMLDetailsElement>("details.help");
  if (help) help.open = !help.open;
}

const PANEL_TITLES: Record<state.Panel, string> = {
  now: "who does what now",
  inspect: "what was selected",
  beliefs: "beliefs",
  events: "events",
  metrics: "metrics",
  layers: "layers and legend",
  notes: "notes",
};

export const SWITCH_WORDS: Record<state.Switch, string> = {
  names: "names",
  furniture: "furniture",
  ways: "ways behind and ahead",
  sight: "what is in view",
  observations: "observations",
  beliefs: "beliefs",
  lights: "the light of the hour",
  slows: "slow floors",
};

export const ACTIONS: readonly Action[] = [
  {
    title: "Play or pause",
    key: " ",
    run: () => {
      if (state.live.value) void orderAll({ action: status.value?.paused ? "resume" : "pause" });
      else state.playing.value = !state.playing.value;
    },
  },
  { title: "Play the story: a reel of its moments", key: "r", run: playReel, isPossible: () => isStored() && state.run.value!.facts.story.length > 0 },
  { title: "A step back", key: ",", run: () => step(-1) },
  { title: "A step forward", key: ".", run: () => step(1) },
  { title: "A day back", key: "[", run: () => goDays(-1) },
  { title: "A day forward", key: "]", run: () => goDays(1) },
  { title: "Next answer, or event of the chosen kind", key: "n", run: () => state.jump(true) },
  { title: "Previous answer, or event of the chosen kind", key: "p", run: () => state.jump(false) },
  { title: "Next failure", key: "v", run: goToFailure, isPossible: () => state.run.value!.facts.marks.some((mark) => mark.kind === "violated") },
  { title: "Begin of the run", key: "Home", run: () => state.goTo(state.beginUs.value) },
  { title: "End of the run", key: "End", run: () => state.goTo(state.endUs.value) },
  { title: "Slower", key: "<", run: () => state.faster(-1) },
  { title: "Faster", key: ">", run: () => state.faster(1) },
  { title: "Zoom in on the timeline", key: "+", run: () => state.zoom(0.5) },
  { title: "Zoom out of the timeline", key: "-", run: () => state.zoom(2) },
  { title: "The whole run on the timeline", key: "0", run: () => state.showRange(state.beginUs.value, state.endUs.value) },
  { title: "This day on the timeline", key: "", run: showDay },
  { title: "The view before the last zoom", key: "z", run: () => state.zoomBack() },
  { title: "Calendar or lanes", key: "y", run: () => (state.view.value = state.view.value === "calendar" ? "lanes" : "calendar") },
  { title: "The whole home on the plan", key: "h", run: () => state.fits.value++ },
  { title: "Keep who is selected in the middle of the plan", key: "c", run: () => (state.followed.value = state.followed.value ? "" : state.selected.value) },
  { title: "Filter the lanes", key: "l", run: () => document.getElementById("filter")?.focus(), isPossible: () => state.view.value === "lanes" },
  { title: "Ask, go to, or do something", key: "a", run: () => document.getElementById("ask")?.focus() },
  { title: "Go to a time", key: "g", run: () => document.getElementById("goto")?.focus() },
  { title: "Search events", key: "f", run: () => focusIn("events", "search") },
  { title: "Bookmark or note at this moment", key: "b", run: () => focusIn("notes", "note") },
  { title: "Save a picture of this view (PNG)", key: "s", run: () => void savePicture() },
  { title: "Save a clip of the marked range, or of the next hour", key: "w", run: () => void saveClip() },
  { title: "A film of the minute around this moment (MP4)", key: "m", run: () => void downloadFilm(state.run.value!), isPossible: isServed },
  { title: "Copy a link to this view", key: "u", run: () => void copyLink(state.run.value!), isPossible: () => state.run.value!.path !== "" },
  { title: "Continue from here: another future", key: "", run: () => void branchHere(state.run.value!), isPossible: () => state.run.value!.path !== "" && state.runs.value.length === 1 },
  { title: "Light or dark", key: "t", run: () => (state.theme.value = dark.value ? "light" : "dark") },
  { title: "Keys", key: "?", run: toggleHelp },
  { title: "Print, or save as PDF", key: "", run: () => window.print() },
  ...state.PANELS.map((panel, i) => ({ title: `Show ${PANEL_TITLES[panel]}`, key: String(i + 1), run: () => void (state.panel.value = panel) })),
  ...state.SWITCHES.map((name) => ({ title: `Show or hide ${SWITCH_WORDS[name]}`, key: "", run: () => state.toggle(name) })),
];

export function possibleActions(): Action[] {
  return ACTIONS.filter(({ isPossible }) => isPossible?.() ?? true);
}

const KEY_WORDS: Record<string, string> = { " ": "Space", "-": "−" };

/** A key as it is written on the page. */
export function keyText(key: string): string {
  return KEY_WORDS[key] ?? key;
}
