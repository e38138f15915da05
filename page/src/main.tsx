/** Open what the page was made to show. */

import { render } from "preact";
import { applyAddress, followAddress } from "./address";
import { App } from "./App";
import { Run } from "./data/run";
import { openSession } from "./data/source";
import { followKeyboard } from "./keyboard";
import { Feed } from "./live/feed";
import { followPlaying } from "./player";
import * as state from "./state";
import "./style.css";
import { followTheme } from "./theme";

async function start(box: HTMLElement): Promise<void> {
  followTheme();
  const session = await openSession();
  const feed = session.facts.live ? await Feed.open() : null;
  const runs = feed ? [feed.run] : await Promise.all(session.sources.map((source) => Run.open(source)));
  if (runs.length === 0) throw new Error("There is no run to show.");
  state.runs.value = runs;
  state.live.value = feed !== null;
  state.setRange(state.beginUs.value, state.endUs.value);
  state.goTo(state.beginUs.value);
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
  document.documentElement.dataset.ready = "true";
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
