/** Let time pass at the chosen speed, or at the pace of what happens. */

import { effect, untracked } from "@preact/signals";
import { paceOf } from "./data/pace";
import * as state from "./state";

export function followPlaying(): void {
  let last = 0;
  const tick = (now: number): void => {
    if (!state.playing.value) return;
    const seconds = Math.min(now - last, 250) / 1000;
    last = now;
    const run = state.run.value;
    const end = state.endUs.value - (run?.clock.stepUs ?? 1);
    const { speed, moment } = state;
    const adapts = speed.value === state.ADAPTIVE && run && !state.live.value;
    const next = adapts ? paceOf(run).after(moment.value, seconds) : moment.value + seconds * 1e6 * Math.max(1, speed.value);
    keepInView(next);
    state.goTo(next);
    if (next >= end && !state.live.value) state.playing.value = false;
    requestAnimationFrame(tick);
  };
  effect(() => {
    if (!state.playing.value) return untracked(() => state.goTo(state.moment.value)); // to a step
    last = performance.now();
    requestAnimationFrame(tick);
  });
}

/** Turn the page when the cursor comes to the end of the timeline. */
function keepInView(us: number): void {
  const [from, to] = state.range.peek();
  if (us > to) state.setRange(us - 0.05 * (to - from), us + 0.95 * (to - from));
}

/**
 * Open a stored run in motion, at its liveliest morning; it loops over that day until somebody touches the page. Who
 * wants less motion, a link to a moment, and a page within another one start paused.
 */
export function openInMotion(): void {
  const run = state.run.value;
  if (!run || run.endUs - run.beginUs < 6 * 3600e6) return;
  const first = paceOf(run).liveliest();
  state.goTo(first);
  const isStill = matchMedia("(prefers-reduced-motion: reduce)").matches || window.parent !== window;
  if (isStill) return;
  state.playing.value = true;
  const dayEnd = run.clock.dayStart(run.clock.day(first) + 1);
  const stopLooping = effect(() => {
    if (state.moment.value >= Math.min(dayEnd, run.endUs) - run.clock.stepUs) untracked(() => state.goTo(first));
  });
  for (const kind of ["pointerdown", "keydown", "wheel"]) addEventListener(kind, stopLooping, { once: true, passive: true });
}
