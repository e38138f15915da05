/** Let time pass at the chosen speed, or at the pace of what happens. */

import { batch, effect, signal, untracked } from "@preact/signals";
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

/** The card of the story that the reel shows; -1: it doesn't play. */
export const reel = signal(-1);
const REEL_MS = 30_000;
/** Cards are played at this speed, from so long before their moment [us]. */
const REEL_SPEED = 20;
const LEAD_US = 30e6;

let stopReel = (): void => {};

/** Play the moments of the story one after the other, each with who is in it, in half a minute; any touch ends it. */
export function playReel(): void {
  const run = state.run.value!;
  const { story } = run.facts;
  stopReel();
  const before = { speed: state.speed.value, followed: state.followed.value };
  const isStill = matchMedia("(prefers-reduced-motion: reduce)").matches;
  let timer: ReturnType<typeof setTimeout> | undefined;
  const show = (at: number): void => {
    const card = story[at];
    if (!card) {
      stopReel();
      return;
    }
    const us = card.step * run.clock.stepUs;
    batch(() => {
      reel.value = at;
      state.followed.value = card.who[0] ?? "";
      state.speed.value = REEL_SPEED;
      state.playing.value = !isStill;
      state.goTo(isStill ? us : us - LEAD_US);
    });
    timer = setTimeout(() => show(at + 1), REEL_MS / story.length);
  };
  const stop = (): void => stopReel();
  stopReel = () => {
    clearTimeout(timer);
    for (const kind of ["pointerdown", "keydown"]) removeEventListener(kind, stop);
    batch(() => {
      reel.value = -1;
      state.playing.value = false;
      state.speed.value = before.speed;
      state.followed.value = before.followed;
      state.fits.value++;
    });
    stopReel = () => {};
  };
  show(0);
  // The press that began the reel is still on its way.
  setTimeout(() => ["pointerdown", "keydown"].forEach((kind) => addEventListener(kind, stop, { once: true })));
}
