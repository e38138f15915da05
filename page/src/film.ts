/** A film of the minute around a moment, which the server makes and the browser stores. */

import { signal } from "@preact/signals";
import type { Run } from "./data/run";
import { fetched } from "./data/source";
import { download } from "./share";
import * as state from "./state";

export const filming = signal(false);

/** The moments at which expectations began to be violated [us]. */
function failuresOf(run: Run): number[] {
  const steps = run.facts.marks.filter((mark) => mark.kind === "violated").map((mark) => mark.step);
  return [...new Set(steps)].sort((a, b) => a - b).map((step) => step * run.clock.stepUs);
}

/** Go to the next failure, after the last one to the first. */
export function goToFailure(): void {
  const run = state.run.value;
  const failures = run ? failuresOf(run) : [];
  const next = failures.find((us) => us > state.moment.value) ?? failures[0];
  if (next !== undefined) state.goTo(next);
}

export async function downloadFilm(run: Run): Promise<void> {
  if (filming.value || !run.path) return;
  filming.value = true;
  const step = run.clock.stepAt(state.moment.value);
  await run.attempt(async () => {
    const film = await (await fetched(`${run.path}/film/${step}.mp4`)).blob();
    download(film, `${run.facts.title} ${run.clock.text(state.moment.value)}.mp4`.replaceAll(/[^\w.-]+/g, "-"));
  });
  filming.value = false;
}
