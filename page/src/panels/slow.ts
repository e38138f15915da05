/** A value that panels of text follow a few times a second, however fast it changes. */

import { effect, type ReadonlySignal, signal } from "@preact/signals";
import { moment } from "../state";

const EVERY_MS = 100;

function slowed<T>(fast: ReadonlySignal<T>): ReadonlySignal<T> {
  const slow = signal(fast.peek());
  let timer: ReturnType<typeof setTimeout> | undefined;
  let last = 0;
  effect(() => {
    void fast.value;
    if (timer !== undefined) return;
    const wait = Math.max(0, EVERY_MS - (performance.now() - last));
    timer = setTimeout(() => {
      timer = undefined;
      last = performance.now();
      slow.value = fast.peek();
    }, wait);
  });
  return slow;
}

export const slowMoment = slowed(moment);
