/** Open what the page was made to show. */

import { render } from "preact";
import { applyAddress, followAddress } from "./address";
import { App } from "./App";
import { DAY_US } from "./data/clock";
import { Run } from "./data/run";
import { openSession } from "./data/source";
import { followKeyboard } from "./keyboard";
import { Feed, show } from "./live/feed";
import { followPlaying, openInMotion } from "./player";
import * as state from "./state";
import "./style.css";
import { followTheme } from "./theme";

/** Runs beside each other at first, as many as the command takes; branches join them. */
const MOST_RUNS = 4;

async function start(box: HTMLElement): Promise<void> {
  followTheme();
  const session = await openSession();
  const stored = await Promise.all(session.sources.map((source) => Run.open(source)));
  const live = session.facts.live[session.facts.live.length - 1];
  const past = stored.find((run) => run.path === live?.of) ?? null;
  if (past) await past.readPoses().then(() => past.readRest());
  const feed = live && (past || !live.of) ? await Feed.open(live, past) : null;
  const runs = feed ? [...(past ? [past] : []), feed.run] : stored.slice(0, MOST_RUNS);
  if (runs.length === 0) throw new Error("There is no run to show.");
  state.runs.value = runs;
  show(feed ? [feed] : []);
  state.setRange(state.beginUs.value, state.endUs.value);
  state.goTo(state.beginUs.value);
  const asked = location.hash.length > 1;
  if (runs.length > 1 || state.endUs.value - state.beginUs.value < 2 * DAY_US || feed || !runs.some(hasPeople)) state.view.value = "lanes";
  applyAddress(location.hash, runs[0]!);
  document.title = `${runs.map((run) => run.facts.title).join(" · ")} – Fleet2D`;
  render(<App />, box);
  if (!feed) await Promise.all(runs.map((run) => run.readPoses()));
  requestAnimationFrame(() => requestAnimationFrame(() => performance.mark("first-picture")));
  followAddress(runs[0]!);
  followKeyboard();
  followPlaying();
  if (feed) feed.follow();
  else await Promise.all(runs.map((run) => run.readRest()));
  if (!feed && !asked) openInMotion();
  document.documentElement.dataset.ready = "true";
}

function hasPeople(run: Run): boolean {
  return run.bodies.some((body) => !body.robot);
}

const box = document.getElementById("page")!;
start(box).catch((error: unknown) => {
  const message = error instanceof Error ? error.message : String(error);
  render(
    <main class="failure">
      <h1>This can't be shown</h1>
      <p role="alert">{message}</p>
    </main>,
    box,
  );
});
