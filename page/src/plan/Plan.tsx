/** The plan of a run at the moment: ground, layers, people, robots. */

import { effect, untracked, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Run } from "../data/run";
import type { Layer } from "../data/layers";
import type { Pose } from "../data/tracks";
import { feedOf } from "../live/feed";
import { askCall, askPlace, branchHere, branching, calling, closeRun, placing } from "../live/orders";
import * as state from "../state";
import { colors, dark, scaleColor } from "../theme";
import { drawBeliefs } from "./beliefs";
import { bodyState } from "../panels/Now";
import { bodyRadius, drawScene, posesAt, slowFloorsAt } from "./bodies";
import { fitted, oncePerFrame } from "./canvas";
import { FOOT, Frame } from "./frame";
import { olderWords } from "./older";
import { cellImage, drawCells, drawGround, drawScale, tracePolygons } from "./ground";
import { type Box, Labels } from "./labels";
import { Light, litRooms, skyAt } from "./light";
import { drawTags } from "./tags";

const FOLLOW_ZOOM = 3;
const READ_MS = 120;

interface Pointer {
  x: number;
  y: number;
  moved: boolean;
  body: string;
}

/** Draws one run on a canvas, and finds what is under the pointer. */
class PlanPainter {
  zoom = 1;
  shift: [number, number] = [0, 0];
  private readonly ground = document.createElement("canvas");
  private groundKey = "";
  private layerImage: HTMLCanvasElement | null = null;
  private layerName = "";
  private layerKey = "";
  private readonly light = new Light();
  private labels: Labels | null = null;
  private nameBoxes: Box[] = [];
  private frame: Frame | null = null;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly run: Run,
    private readonly other: Run | null,
  ) {}

  paint(): void {
    const { context, width, height } = fitted(this.canvas);
    if (width === 0 || height === 0) return;
    this.centre(width, height);
    const frame = Frame.fit(this.run.home, width, height, this.zoom, this.shift);
    this.frame = frame;
    const ratio = window.devicePixelRatio || 1;
    this.paintGround(frame, width, height, ratio);
    const { run } = this;
    const us = state.moment.value;
    const shows = (name: string): boolean => state.shown.value.has(name as state.Switch);
    const picture = shows("lights") ? this.light.of(this.ground, this.groundKey, run, us, frame, ratio) : this.ground;
    context.clearRect(0, 0, width, height);
    context.drawImage(picture, 0, 0, width, height);
    if (this.layerImage && this.layerName === state.layer.value) this.paintCells(context, frame, this.layerImage, 0.7);
    if (state.shown.value.has("beliefs")) drawBeliefs(context, this.run, frame, state.moment.value);
    const selected = state.selected.value;
    const poses = posesAt(run, us);
    if (shows("names")) this.paintNames(context, frame, poses, us, shows("lights"));
    drawScene(context, { run, us, poses, frame, colors: colors.value, selected, steps: state.playing.value, shows, other: this.other });
    if (shows("names")) drawTags(context, run, poses, frame, this.nameBoxes, width, height);
    drawScale(context, run.home, frame, colors.value, height);
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "right";
    context.fillStyle = colors.value.text;
    context.fillText(olderWords(this.run), width - 8, height - 5);
    context.textAlign = "left";
  }

  /** Keep the body that is followed in the middle. */
  private centre(width: number, height: number): void {
    const pose = state.followed.value && this.run.tracks.get(state.followed.value)?.poseAt(state.moment.value);
    if (!pose || pose.away) return;
    this.zoom = Math.max(this.zoom, FOLLOW_ZOOM);
    const frame = Frame.fit(this.run.home, width, height, this.zoom);
    this.shift = [width / 2 - frame.ux(pose.x), (height - FOOT) / 2 - frame.uy(pose.y)];
  }

  private paintGround(frame: Frame, width: number, height: number, ratio: number): void {
    const withFurniture = state.shown.value.has("furniture");
    const key = [width, height, ratio, this.zoom, ...this.shift, dark.value, withFurniture].join();
    if (key === this.groundKey) return;
    this.groundKey = key;
    this.ground.width = Math.round(width * ratio);
    this.ground.height = Math.round(height * ratio);
    drawGround(this.ground, this.run.home, frame, ratio, colors.value, withFurniture);
    this.labels = new Labels(this.ground.getContext("2d")!, this.run.home, frame, withFurniture);
  }

  /** Write the names of rooms where no body is, pale in the dark. */
  private paintNames(context: CanvasRenderingContext2D, frame: Frame, poses: ReadonlyMap<string, Pose>, us: number, hasLight: boolean): void {
    const bodies = this.run.bodies.flatMap((body) => {
      const pose = poses.get(body.name);
      return pose && !pose.away ? [{ x: frame.ux(pose.x), y: frame.uy(pose.y), radius: 1.6 * bodyRadius(frame, body) }] : [];
    });
    const isNight = hasLight && skyAt(this.run, us).day < 0.5;
    const lit = isNight ? litRooms(this.run, us) : null;
    this.nameBoxes = this.labels!.draw(context, bodies, (room) => (lit && !lit.has(room) ? "#e8ecf8" : "#4a4438"));
  }

  private paintCells(context: CanvasRenderingContext2D, frame: Frame, image: HTMLCanvasElement, opacity: number): void {
    context.save();
    tracePolygons(context, frame, this.run.facts.home.free.flat());
    context.clip("evenodd");
    context.globalAlpha = opacity;
    drawCells(context, this.run.home, frame, image);
    context.restore();
  }

  async loadLayer(name: string, step: number): Promise<void> {
    const layer = name ? await (await this.run.layer(name)).at(step) : null;
    const key = `${name}@${layer?.step}`;
    if (key === this.layerKey) return;
    this.layerKey = key;
    this.layerName = name;
    this.layerImage = layer && layerImage(this.run, layer);
    this.run.layerUs.value = layer && layer.step * this.run.clock.stepUs;
  }

  /** The body at a pixel; empty where there is none. */
  bodyAt(px: number, py: number): string {
    const { frame, run } = this;
    if (!frame) return "";
    let [nearest, best] = ["", 12];
    for (const body of run.bodies) {
      const pose = run.tracks.get(body.name)?.poseAt(state.moment.value);
      if (!pose || pose.away) continue;
      const far = Math.hypot(frame.ux(pose.x) - px, frame.uy(pose.y) - py) - bodyRadius(frame, body);
      if (far < best) [nearest, best] = [body.name, far];
    }
    return nearest;
  }

  /** What is at a pixel, as `inspect` names it: a body, a door, or a room. */
  thingAt(px: number, py: number): string {
    const { frame, run } = this;
    if (!frame) return "";
    const body = this.bodyAt(px, py);
    if (body) return body;
    const [x, y] = frame.place(px, py);
    const door = run.facts.home.doors.find((entry) => {
      const [mx, my] = [(entry.start[0] + entry.end[0]) / 2, (entry.start[1] + entry.end[1]) / 2];
      return Math.hypot(mx - x, my - y) * frame.scale < 14;
    });
    if (door) return door.name;
    const thing = state.shown.value.has("furniture") ? run.facts.home.objects.find((entry) => isInside(entry.outline, x, y)) : undefined;
    if (thing) return thing.name;
    const room = run.home.roomAt(run.home.units(x, 0), run.home.units(y, 1));
    return room >= 0 ? run.home.roomName(room) : "";
  }

  /** What is at a pixel, with its figures, in words. */
  wordsAt(px: number, py: number): string {
    const { run } = this;
    const name = this.thingAt(px, py);
    if (!name) return "";
    const now = bodyState(run, name, state.moment.value);
    if (now) return [name, now.room, now.activity, now.sees.length > 0 ? `sees ${now.sees.join(", ")}` : ""].filter(Boolean).join(" · ").replaceAll("_", " ");
    const room = run.facts.home.rooms[run.home.roomIndex(name)];
    if (room) {
      const floor = slowFloorsAt(run, state.moment.value).find((entry) => isInside(entry.outline, ...this.frame!.place(px, py)));
      const isUnlit = run.unlitAt(state.moment.value).includes(run.home.roomIndex(name));
      return [`${name} · ${room.area_m2.toFixed(1)} m²`, isUnlit ? "light off" : "", floor?.words ?? ""].filter(Boolean).join(" · ").replaceAll("_", " ");
    }
    const door = run.facts.home.doors.some((entry) => entry.name === name);
    return (door ? `${name} · ${run.doorOpen(name, state.moment.value) ? "open" : "shut"}` : name).replaceAll("_", " ");
  }

  placeAt(px: number, py: number): [number, number] | null {
    return this.frame?.place(px, py) ?? null;
  }
}

/** Whether a point is inside an outline. */
function isInside(outline: readonly (readonly [number, number])[], x: number, y: number): boolean {
  let inside = false;
  outline.forEach(([x0, y0], i) => {
    const [x1, y1] = outline[(i + 1) % outline.length]!;
    if (y0 > y !== y1 > y && x < x0 + ((y - y0) / (y1 - y0)) * (x1 - x0)) inside = !inside;
  });
  return inside;
}

function layerImage(run: Run, layer: Layer): HTMLCanvasElement {
  const width = layer.high - layer.low || 1;
  return cellImage(run.home, (cell) => {
    const value = layer.values[cell]!;
    if (run.home.cells[cell]! < 0 || Number.isNaN(value)) return null;
    if (layer.low >= 0 && layer.high <= 1 && value === 0) return null;
    return [...scaleColor((value - layer.low) / width), 255];
  });
}

export function Plan({ run, other, title }: { run: Run; other: Run | null; title: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const hover = useSignal<{ words: string; x: number; y: number } | null>(null);
  useEffect(() => {
    const painter = new PlanPainter(canvas.current!, run, other);
    const repaint = oncePerFrame(() => painter.paint());
    const stopPainting = effect(() => {
      void [run.version.value, state.moment.value, state.shown.value, state.selected.value];
      void [state.layer.value, state.belief.value, state.followed.value, colors.value, other?.version.value];
      repaint();
    });
    const stopReading = readAtMoment(run, painter, repaint);
    const observer = new ResizeObserver(repaint);
    observer.observe(canvas.current!);
    const stopPointing = followPointer(canvas.current!, run, painter, repaint, hover);
    return () => {
      stopPainting();
      stopReading();
      stopPointing();
      observer.disconnect();
    };
  }, [run, other]);
  return (
    <figure class="plan">
      <canvas ref={canvas} role="img" aria-label={`Floor plan of ${run.facts.home.name}, ${title}`} />
      {hover.value && (
        <output class="hover" aria-live="off" style={{ left: `${hover.value.x}px`, top: `${hover.value.y}px` }} data-side={hover.value.x > 400 ? "left" : "right"}>
          {hover.value.words}
        </output>
      )}
      {title && (
        <figcaption>
          {title}
          {run.path && (
            <button type="button" disabled={branching.value} onClick={() => void branchHere(run)}>
              Continue from here
            </button>
          )}
          <button type="button" aria-label={`Close ${title}`} onClick={() => closeRun(run)}>
            ×
          </button>
        </figcaption>
      )}
    </figure>
  );
}

/** Read the observations and the layer of the moment, several times a second while it changes. */
function readAtMoment(run: Run, painter: PlanPainter, repaint: () => void): () => void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  let last = "";
  const wanted = (): string => `${state.layer.value}@${run.clock.stepAt(state.moment.value)}${run.observations ? "" : " alone"}`;
  const readNext = (): void => {
    if (wanted() === last || timer !== undefined) return;
    timer = setTimeout(() => {
      last = wanted();
      const { observations } = run;
      const step = run.clock.stepAt(state.moment.value);
      const isMissing = observations?.at(step) === null;
      const read = run.attempt(async () => {
        await Promise.all([observations?.load(step), painter.loadLayer(state.layer.value, step)]);
        repaint();
        if (isMissing) run.changed();
      });
      void read.then(() => {
        timer = undefined;
        untracked(readNext); // the moment may have changed meanwhile
      });
    }, READ_MS);
  };
  const stop = effect(() => {
    void run.version.value;
    readNext();
  });
  return () => {
    stop();
    clearTimeout(timer);
  };
}

function followPointer(
  canvas: HTMLCanvasElement,
  run: Run,
  painter: PlanPainter,
  repaint: () => void,
  hover: { value: { words: string; x: number; y: number } | null },
): () => void {
  let held: Pointer | null = null;
  /** Fingers on the plan, by their pointers: two of them zoom. */
  const fingers = new Map<number, [number, number]>();
  const at = (event: PointerEvent | WheelEvent): [number, number] => [event.offsetX, event.offsetY];
  const down = (event: PointerEvent): void => {
    const [x, y] = at(event);
    if (event.pointerType === "touch") fingers.set(event.pointerId, [x, y]);
    hover.value = null;
    held = { x, y, moved: false, body: feedOf(run) ? painter.bodyAt(x, y) : "" };
    canvas.setPointerCapture(event.pointerId);
  };
  const move = (event: PointerEvent): void => {
    const [x, y] = at(event);
    const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
    if (other && fingers.has(event.pointerId)) {
      const before = fingers.get(event.pointerId)!;
      const far = Math.hypot(x - other[0], y - other[1]);
      zoomAbout((x + other[0]) / 2, (y + other[1]) / 2, far / Math.hypot(before[0] - other[0], before[1] - other[1]));
      fingers.set(event.pointerId, [x, y]);
      held = null;
      return;
    }
    if (!held) {
      const words = painter.wordsAt(x, y);
      hover.value = words ? { words, x, y } : null;
      return;
    }
    if (!held.moved && Math.hypot(x - held.x, y - held.y) < 4) return;
    held.moved = true;
    if (held.body) return;
    state.followed.value = "";
    painter.shift = [painter.shift[0] + x - held.x, painter.shift[1] + y - held.y];
    [held.x, held.y] = [x, y];
    repaint();
  };
  const up = (event: PointerEvent): void => {
    const [x, y] = at(event);
    fingers.delete(event.pointerId);
    const place = painter.placeAt(x, y);
    if (held?.moved && held.body && place) void askPlace(run, held.body, ...place);
    else if (held && !held.moved && calling.value && place) void askCall(run, calling.value, ...place);
    else if (held && !held.moved && placing.value && place) void askPlace(run, placing.value, ...place);
    else if (held && !held.moved) state.select(painter.thingAt(x, y));
    held = null;
  };
  const wheel = (event: WheelEvent): void => {
    event.preventDefault();
    zoomAbout(event.offsetX, event.offsetY, Math.exp(-event.deltaY * 0.0015));
  };
  const zoomAbout = (px: number, py: number, factor: number): void => {
    if (!Number.isFinite(factor)) return;
    const next = Math.max(1, Math.min(40, painter.zoom * factor));
    const [x, y] = [px - canvas.clientWidth / 2, py - (canvas.clientHeight - FOOT) / 2];
    const share = next / painter.zoom;
    painter.shift = next === 1 ? [0, 0] : [x - (x - painter.shift[0]) * share, y - (y - painter.shift[1]) * share];
    painter.zoom = next;
    repaint();
  };
  const showWholePlan = (): void => {
    state.followed.value = "";
    painter.zoom = 1;
    painter.shift = [0, 0];
    repaint();
  };
  canvas.addEventListener("pointerdown", down);
  canvas.addEventListener("pointermove", move);
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("wheel", wheel, { passive: false });
  const leave = (): void => {
    hover.value = null;
  };
  canvas.addEventListener("pointerleave", leave);
  canvas.addEventListener("dblclick", showWholePlan);
  return () => {
    canvas.removeEventListener("pointerdown", down);
    canvas.removeEventListener("pointermove", move);
    canvas.removeEventListener("pointerup", up);
    canvas.removeEventListener("wheel", wheel);
    canvas.removeEventListener("pointerleave", leave);
    canvas.removeEventListener("dblclick", showWholePlan);
  };
}
