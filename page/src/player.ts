/** Let time pass at the chosen speed. */

import { effect, untracked } from "@preact/signals";
import * as state from "./state";

export function followPlaying(): void {
  let last = 0;
  const tick = (now: number): void => {
    if (!state.playing.value) return;
    const passed = Math.min(now - last, 250) * 1000 * state.speed.value;
    last = now;
    const end = state.endUs.value - (state.run.value?.clock.stepUs ?? 1);
    const next = state.moment.value + passed;
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
