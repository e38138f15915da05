/** What is on the plan as a picture or a clip, made by the browser alone. */

import { signal } from "@preact/signals";
import * as state from "./state";
import { colors } from "./theme";

/** The share of a clip that is recorded; null while none is. */
export const recording = signal<number | null>(null);

const CLIP_S = 10;
const CLIP_RATE = 30;
const HOUR_US = 3600e6;
const MARGIN = 14;
/** Formats in the order in which they are wanted; every browser that records has one. */
const FORMATS = [
  ["video/mp4;codecs=avc1.42E01F", "mp4"],
  ["video/mp4", "mp4"],
  ["video/webm;codecs=vp9", "webm"],
  ["video/webm", "webm"],
] as const;

function nameOf(ending: string): string {
  const run = state.run.value!;
  return `${run.facts.title} ${run.clock.text(state.moment.value)}`.replaceAll(/[^\w.-]+/g, "-") + `.${ending}`;
}

/** Have the browser store a file. */
export function download(content: Blob, name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(content);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

/** Draw all plans as they are shown, with the clock, the title of the run and its digest. */
export function drawView(canvas: HTMLCanvasElement): void {
  const plans = document.querySelector(".plans")!;
  const box = plans.getBoundingClientRect();
  const ratio = window.devicePixelRatio || 1;
  // Encoders of films want even numbers of pixels.
  const [width, height] = [2 * Math.ceil((box.width * ratio) / 2), 2 * Math.ceil((box.height * ratio) / 2)];
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d")!;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.fillStyle = colors.value.stage;
  context.fillRect(0, 0, box.width, box.height);
  for (const part of plans.querySelectorAll<HTMLCanvasElement>(".plan canvas")) {
    const { left, top, width: wide, height: tall } = part.getBoundingClientRect();
    if (wide > 0) context.drawImage(part, left - box.left, top - box.top, wide, tall);
  }
  writeCaption(context, box.width, box.height);
}

function writeCaption(context: CanvasRenderingContext2D, width: number, height: number): void {
  const { clock, facts } = state.run.value!;
  const us = state.moment.value;
  context.textBaseline = "top";
  context.textAlign = "left";
  context.fillStyle = colors.value.text;
  context.font = "650 40px system-ui, sans-serif";
  context.fillText(clock.timeText(us, false), MARGIN, MARGIN);
  context.fillStyle = colors.value.quiet;
  context.font = "500 15px system-ui, sans-serif";
  context.fillText(clock.dateText(us), MARGIN, MARGIN + 44);
  context.textAlign = "right";
  context.textBaseline = "alphabetic";
  context.font = "500 12px system-ui, sans-serif";
  const titles = state.runs.value.map((run) => run.facts.title).join(" · ");
  context.fillText([titles, facts.digest?.slice(0, 8), "Fleet2D"].filter(Boolean).join(" · "), width - MARGIN, height - 22);
}

export async function savePicture(): Promise<void> {
  const canvas = document.createElement("canvas");
  drawView(canvas);
  const content = await new Promise<Blob | null>((resolve) => canvas.toBlob(resolve, "image/png"));
  if (content) download(content, nameOf("png"));
  else state.run.value!.report("The browser can't make a picture of this size: make the window smaller.");
}

/** Record the marked range, or the hour from the moment on, in ten seconds. */
export async function saveClip(): Promise<void> {
  if (recording.value !== null) return;
  const run = state.run.value!;
  const format = typeof MediaRecorder === "undefined" ? undefined : FORMATS.find(([type]) => MediaRecorder.isTypeSupported(type));
  if (!format) {
    run.report("This browser records no clips: a film by the server (m) needs none.");
    return;
  }
  const marked = state.marked.value;
  const now = state.moment.value;
  const [from, to] = marked ? [Math.min(...marked), Math.max(...marked)] : [now, Math.min(now + HOUR_US, state.endUs.value)];
  const canvas = document.createElement("canvas");
  state.playing.value = false;
  state.goTo(from);
  await nextFrame();
  drawView(canvas);
  const recorder = new MediaRecorder(canvas.captureStream(CLIP_RATE), { mimeType: format[0], videoBitsPerSecond: 6_000_000 });
  const parts: Blob[] = [];
  recorder.ondataavailable = (event) => parts.push(event.data);
  const isStopped = new Promise((resolve) => (recorder.onstop = resolve));
  recorder.start();
  recording.value = 0;
  const begin = performance.now();
  while (recording.value !== null && recording.value < 1) {
    await nextFrame();
    if (recording.value === null) break; // somebody stopped it
    recording.value = Math.min(1, (performance.now() - begin) / 1000 / CLIP_S);
    state.goTo(from + recording.value * (to - from));
    await nextFrame();
    drawView(canvas);
  }
  recorder.stop();
  await isStopped;
  recording.value = null;
  download(new Blob(parts, { type: recorder.mimeType }), nameOf(format[1]));
  state.goTo(now);
}

export function stopClip(): void {
  recording.value = null;
}

function nextFrame(): Promise<number> {
  return new Promise(requestAnimationFrame);
}
