/** What the page asks of running simulations, and of the server: branches. */

import { batch, signal } from "@preact/signals";
import type { BranchOrder, LiveOrder, LiveSession, Problem } from "../contract";
import type { Run } from "../data/run";
import { SERVER_GONE } from "../data/source";
import * as state from "../state";
import { Feed, feedOf, feeds, show } from "./feed";

/** The body that the next click on the plan puts somewhere; empty: none. */
export const placing = signal("");
/** The body that goes where the next click on the plan is; empty: none. */
export const calling = signal("");
/** Why the last order was refused; empty if it was not. */
export const refusal = signal("");
/** Whether the server repeats a run for a branch. */
export const branching = signal(false);

async function post<T>(url: string, content: object): Promise<T | null> {
  const headers = { "Content-Type": "application/json" };
  const response = await fetch(url, { method: "POST", headers, body: JSON.stringify(content) }).catch(() => null);
  if (!response) {
    refusal.value = SERVER_GONE;
    return null;
  }
  const answer: unknown = await response.json().catch(() => null);
  refusal.value = response.ok ? "" : ((answer as Problem | null)?.message ?? `refused: ${response.status}`);
  return response.ok ? (answer as T) : null;
}

type Wish = Partial<LiveOrder> & Pick<LiveOrder, "action">;

/** Ask something of the simulation of a run, or of the one that was begun last. */
export async function order(wish: Wish, run?: Run): Promise<void> {
  const feed = (run && feedOf(run)) ?? feeds.value[feeds.value.length - 1];
  const complete: LiveOrder = { target: "", value: 0, x: 0, y: 0, key: "", text: "", ...wish };
  if (feed) await post(`${feed.run.path}/order`, complete);
}

/** Ask something of all simulations that are under way, so that they stay in step. */
export async function orderAll(wish: Wish): Promise<void> {
  await Promise.all(feeds.value.map((feed) => order(wish, feed.run)));
}

export async function askPlace(run: Run, name: string, x: number, y: number): Promise<void> {
  placing.value = "";
  await order({ action: "place", target: name, x, y }, run);
}

export async function askCall(run: Run, name: string, x: number, y: number): Promise<void> {
  calling.value = "";
  await order({ action: "call", target: name, x, y }, run);
}

/** Continue a run from the moment that is shown, beside the run itself. */
export async function branchHere(run: Run): Promise<void> {
  const wish: BranchOrder = { of: run.path, step: run.clock.stepAt(state.moment.value) };
  if (feedOf(run)) await order({ action: "pause" }, run);
  branching.value = true;
  try {
    const session = await post<LiveSession>("branch", wish);
    if (!session) return;
    const branch = await Feed.open(session, run);
    const own = feedOf(run);
    feeds.value.filter((feed) => feed !== own).forEach((feed) => feed.close());
    batch(() => {
      show(own ? [own, branch] : [branch]);
      state.runs.value = [run, branch.run];
      state.playing.value = false;
      state.follow.value = true;
    });
    branch.follow();
  } finally {
    branching.value = false;
  }
}

/** Show one of the runs no longer; a simulation goes on. */
export function closeRun(run: Run): void {
  feedOf(run)?.close();
  state.runs.value = state.runs.value.filter((entry) => entry !== run);
  state.goTo(state.moment.value);
}
