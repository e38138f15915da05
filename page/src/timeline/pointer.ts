/** What the pointer does on the timeline: scrub, pan, pinch, choose a range, snap to events. */

import { batch } from "@preact/signals";
import { firstAtLeast } from "../data/search";
import * as state from "../state";
import { AXIS_HEIGHT, type PlacedRow, rowAt, type Scale, usOf, xOf } from "./draw";

/** A click this near to an event goes to it [pixels]. */
const SNAP = 5;
const CLICK = 3;

export interface PointerView {
  box: HTMLElement;
  rows: () => readonly PlacedRow[];
  /** What is under the pointer, and where that is in the window. */
  hover: (row: PlacedRow | null, us: number, x: number, y: number) => void;
}

export function scaleOf(width: number): Scale {
  const [from, to] = state.range.value;
  return { from, to, width };
}

/** The moment of the event in a row that is nearest to a moment, if it is near enough. */
export function snapped(row: PlacedRow | null, us: number, scale: Scale): number {
  const paint = row?.lane?.paint();
  const moments =
    paint?.kind === "stretches" ? [paint.stretches.from, paint.stretches.to] : paint?.kind === "ticks" ? [paint.us] : paint?.kind === "line" ? [paint.series.us] : [];
  let [best, nearest] = [us, SNAP];
  for (const list of moments) {
    const i = firstAtLeast(list, us);
    for (const candidate of [list[i - 1], list[i]]) {
      if (candidate === undefined) continue;
      const far = Math.abs(xOf(scale, candidate) - xOf(scale, us));
      if (far < nearest) [best, nearest] = [candidate, far];
    }
  }
  return best;
}

export function followPointer({ box, rows, hover }: PointerView): () => void {
  let mode: "scrub" | "pan" | "range" | null = null;
  let [lastX, startX] = [0, 0];
  /** Fingers on the timeline, by their pointers: two of them zoom. */
  const fingers = new Map<number, number>();
  const place = (event: MouseEvent): [number, number] => {
    const { left, top } = box.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  };
  const scale = (): Scale => scaleOf(box.clientWidth);
  const down = (event: PointerEvent): void => {
    const [x, y] = place(event);
    box.setPointerCapture(event.pointerId);
    if (event.pointerType === "touch") fingers.set(event.pointerId, x);
    [startX, lastX] = [x, x];
    mode = fingers.size > 1 ? null : event.shiftKey ? "range" : event.button === 1 || event.altKey ? "pan" : "scrub";
    state.follow.value = false;
    const us = usOf(scale(), x);
    if (mode === "scrub") state.goTo(snapped(rowAt(rows(), y), us, scale()));
    else if (mode === "range") state.marked.value = [us, us];
  };
  const move = (event: PointerEvent): void => {
    const [x, y] = place(event);
    const us = usOf(scale(), x);
    if (fingers.has(event.pointerId) && fingers.size === 2) pinch(event.pointerId, x);
    else if (mode === "scrub" && Math.abs(x - startX) >= CLICK) state.goTo(us, true);
    else if (mode === "range") state.marked.value = [usOf(scale(), startX), us];
    else if (mode === "pan") {
      const [from, to] = state.range.value;
      state.pan(((lastX - x) / box.clientWidth) * (to - from));
      lastX = x;
    }
    hover(rowAt(rows(), y), us, event.clientX, event.clientY);
  };
  const pinch = (pointer: number, x: number): void => {
    const other = [...fingers].find(([id]) => id !== pointer)![1];
    const before = Math.abs(fingers.get(pointer)! - other);
    fingers.set(pointer, x);
    const after = Math.abs(x - other);
    if (before > 8 && after > 8) state.zoom(before / after, usOf(scale(), (x + other) / 2));
  };
  const up = (event: PointerEvent): void => {
    const [x] = place(event);
    if (mode === "range" && Math.abs(x - startX) < CLICK) state.marked.value = null;
    fingers.delete(event.pointerId);
    mode = null;
  };
  const leave = (): void => hover(null, 0, 0, 0);
  const wheel = (event: WheelEvent): void => {
    const [x, y] = place(event);
    if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
      const [from, to] = state.range.value;
      state.pan(((event.deltaX || event.deltaY) / box.clientWidth) * (to - from));
    } else {
      const scroller = box.parentElement!;
      const scrolls = scroller.scrollHeight > scroller.clientHeight + 1;
      if (scrolls && y >= AXIS_HEIGHT && !event.ctrlKey && !event.metaKey) return;
      state.zoom(Math.exp(event.deltaY * 0.0018), usOf(scale(), x));
    }
    event.preventDefault();
  };
  const showWholeRun = (): void =>
    batch(() => {
      state.marked.value = null;
      state.showRange(state.beginUs.value, state.endUs.value);
    });
  const listeners = { pointerdown: down, pointermove: move, pointerup: up, pointercancel: up, pointerleave: leave, dblclick: showWholeRun };
  for (const [name, listener] of Object.entries(listeners)) box.addEventListener(name, listener as EventListener);
  box.addEventListener("wheel", wheel, { passive: false });
  return () => {
    for (const [name, listener] of Object.entries(listeners)) box.removeEventListener(name, listener as EventListener);
    box.removeEventListener("wheel", wheel);
  };
}
