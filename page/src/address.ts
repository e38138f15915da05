/** The address holds the moment and the view, so that it can be shared. */

import { effect } from "@preact/signals";
import type { Run } from "./data/run";
import * as state from "./state";
import * as lanes from "./timeline/rows";

const DELAY_MS = 250;

/** What the address says of the view, without the leading #. */
export function addressOf(run: Run): string {
  const { clock } = run;
  const [from, to] = state.range.value;
  const words = new URLSearchParams();
  words.set("at", clock.stampText(state.told.value));
  if (from > state.beginUs.value || to < state.endUs.value) {
    words.set("from", clock.stampText(from));
    words.set("to", clock.stampText(to));
  }
  words.set("show", state.SWITCHES.filter((name) => state.shown.value.has(name)).join(","));
  words.set("panel", state.panel.value);
  words.set("view", state.view.value);
  if (state.speed.value !== state.ADAPTIVE) words.set("speed", String(state.speed.value));
  const optional = {
    select: state.selected.value,
    layer: state.layer.value,
    belief: state.belief.value,
    kind: state.eventKind.value,
    body: state.followed.value,
    plot: state.plot.value,
    ask: state.question.value?.text ?? "",
    lanes: lanes.filter.value,
    theme: state.theme.value === "auto" ? "" : state.theme.value,
  };
  for (const [name, value] of Object.entries(optional)) if (value) words.set(name, value);
  const marked = state.marked.value;
  if (marked) words.set("marked", marked.map((us) => clock.stampText(us)).join("~"));
  for (const lane of lanes.pinned.value) words.append("pin", lane);
  for (const lane of lanes.hidden.value) words.append("hide", lane);
  return words.toString();
}

export function applyAddress(text: string, run: Run): void {
  const words = new URLSearchParams(text.replace(/^#/, ""));
  const us = (name: string): number | null => momentOf(words.get(name));
  const momentOf = (value: string | null): number | null => {
    return value === null ? null : run.clock.ofStamp(value);
  };
  const [from, to, at] = [us("from"), us("to"), us("at")];
  if (from !== null && to !== null && to > from) state.setRange(from, to);
  if (at !== null) state.goTo(at);
  reportUnknown(words, at, run);
  const show = words.get("show");
  if (show !== null) {
    const names = show.split(",");
    state.shown.value = new Set(state.SWITCHES.filter((name) => names.includes(name)));
  }
  const panel = state.PANELS.find((name) => name === words.get("panel"));
  if (panel) state.panel.value = panel;
  const speed = Number(words.get("speed"));
  if (speed > 0 && speed <= 86_400) state.speed.value = speed;
  const view = words.get("view");
  if (view === "calendar" || view === "lanes") state.view.value = view;
  state.selected.value = words.get("select") ?? "";
  const layer = words.get("layer") ?? "";
  state.layer.value = run.tableFacts(`layer.${layer}`) ? layer : "";
  state.belief.value = words.get("belief") ?? "";
  state.eventKind.value = words.get("kind") ?? "";
  state.followed.value = words.get("body") ?? "";
  state.plot.value = words.get("plot") ?? "";
  const asked = words.get("ask");
  state.question.value = asked ? { text: asked, nearUs: state.moment.value } : null;
  const [first, last] = (words.get("marked") ?? "").split("~").map(momentOf);
  state.marked.value = typeof first === "number" && typeof last === "number" ? [first, last] : null;
  lanes.pinned.value = new Set(words.getAll("pin"));
  lanes.hidden.value = new Set(words.getAll("hide"));
  lanes.filter.value = words.get("lanes") ?? "";
  const theme = words.get("theme");
  if (theme === "light" || theme === "dark") state.theme.value = theme;
}

/** Say what a link names that the run doesn't have: it may be of another run, or of an older one. */
function reportUnknown(words: URLSearchParams, at: number | null, run: Run): void {
  const { doors, objects, rooms } = run.facts.home;
  const tables = run.facts.tables.map(({ name }) => name);
  const bodies = run.bodies.map(({ name }) => name);
  const known: Record<string, readonly string[]> = {
    select: [...bodies, ...[...rooms, ...doors, ...objects].map(({ name }) => name)],
    body: bodies,
    layer: tables.filter((name) => name.startsWith("layer.")).map((name) => name.slice("layer.".length)),
  };
  for (const [key, names] of Object.entries(known)) {
    const name = words.get(key);
    if (name && !names.includes(name)) run.report(`The link names ${key === "layer" ? "the layer " : ""}'${name}', which this run doesn't have.`);
  }
  if (at === null || (at >= run.beginUs && at < run.endUs)) return;
  run.report(`The link is about ${run.clock.text(at)}, which this run doesn't have: it lasts from ${run.clock.text(run.beginUs)} to ${run.clock.text(run.endUs)}.`);
}

/** Copy a link to what is shown now; false where the browser refuses. */
export async function copyLink(run: Run): Promise<boolean> {
  try {
    await navigator.clipboard.writeText(`${location.href.split("#")[0]}#${addressOf(run)}`);
    return true;
  } catch {
    return false;
  }
}

/** Keep the address up to date, and follow it when it is changed. */
export function followAddress(run: Run): void {
  let lastHash = "";
  let timer: ReturnType<typeof setTimeout> | undefined;
  effect(() => {
    const address = addressOf(run);
    clearTimeout(timer);
    timer = setTimeout(() => {
      lastHash = `#${address}`;
      try {
        history.replaceState(null, "", lastHash);
      } catch {
        // A frame in a notebook has no address of its own.
      }
    }, DELAY_MS);
  });
  addEventListener("hashchange", () => {
    if (location.hash !== lastHash) applyAddress(location.hash, run);
  });
}
