/** Paints a run at a moment on two canvases: the home in its light, and above it what moves. */

import { bodyState } from "../panels/Now";
import type { Layer } from "../data/layers";
import type { Run } from "../data/run";
import type { Pose } from "../data/tracks";
import { doing } from "../data/words";
import * as state from "../state";
import { colors, scaleColor } from "../theme";
import { Backdrop, type Stage } from "./backdrop";
import { drawBeliefs } from "./beliefs";
import { bodyRadius, drawScene, figureDisc, posesAt, slowFloorsAt } from "./bodies";
import { fitted } from "./canvas";
import { Frame } from "./frame";
import { cellImage, drawCells, drawScale, tracePolygons } from "./ground";
import { type Box, Labels } from "./labels";
import { drawKeptOut } from "./kept_out";
import { litRooms, skyAt } from "./light";
import { olderWords } from "./older";
import { Tags } from "./tags";

const FOLLOW_ZOOM = 3;
const MOST_ZOOM = 40;
const PALE_NAME = "#e8ecf8";
const DARK_NAME = "#4a4438";
/** A body is under the pointer if it is this near to it [px]. */
const REACH_PX = 12;
const DOOR_PX = 14;

export class PlanPainter {
  private zoom = 1;
  private shift: readonly [number, number] = [0, 0];
  private readonly backdrop: Backdrop;
  private readonly tags = new Tags();
  private labels: Labels | null = null;
  private labelsKey = "";
  private drawn = "";
  private layerImage: HTMLCanvasElement | null = null;
  private layerName = "";
  private layerKey = "";
  private frame: Frame | null = null;
  /** Pixels at the top left that stay free. */
  corner: readonly [number, number] = [0, 0];

  constructor(
    private readonly base: HTMLCanvasElement,
    private readonly top: HTMLCanvasElement,
    private readonly run: Run,
    private readonly other: Run | null,
  ) {
    this.backdrop = new Backdrop(run);
  }

  get isWhole(): boolean {
    return this.zoom === 1 && this.shift[0] === 0 && this.shift[1] === 0;
  }

  paint(): void {
    const { context, width, height } = fitted(this.top);
    if (width === 0 || height === 0) return;
    const { run } = this;
    const us = state.moment.value;
    this.centre(width, height);
    const frame = this.framed(width, height);
    this.frame = frame;
    const shows = (name: string): boolean => state.shown.value.has(name as state.Switch);
    const stage: Stage = {
      frame,
      width,
      height,
      ratio: window.devicePixelRatio || 1,
      colors: colors.value,
      withFurniture: shows("furniture"),
      withLight: shows("lights"),
    };
    const poses = posesAt(run, us);
    const names = shows("names") ? this.placeNames(stage, poses, us) : [];
    // Lamps of a crowd change at every frame: like words, they follow several times a second while time passes.
    this.paintBase(stage, state.told.value, shows("names"));
    context.clearRect(0, 0, width, height);
    drawKeptOut(context, run, state.selected.value, frame, colors.value);
    if (shows("beliefs")) drawBeliefs(context, run, frame, us);
    const selected = state.selected.value;
    drawScene(context, { run, us, poses, frame, colors: colors.value, selected, steps: state.playing.value, shows, other: this.other });
    const hidden = shows("names") ? this.tags.draw(context, { run, us, poses, frame, names, width, height, selected }) : 0;
    this.writeFoot(context, us, hidden, width, height);
  }

  /** Draw the home, its layer of cells and the names of rooms, if they changed. */
  private paintBase(stage: Stage, us: number, withNames: boolean): void {
    const isLayerShown = this.layerImage !== null && this.layerName === state.layer.value;
    const night = stage.withLight && skyAt(this.run, us).day < 0.5;
    const key = [this.backdrop.key(stage, us), isLayerShown && this.layerKey, withNames && this.labels?.key, night].join(" ");
    if (key === this.drawn) return;
    this.drawn = key;
    const { context, width, height } = fitted(this.base);
    context.clearRect(0, 0, width, height);
    context.drawImage(this.backdrop.picture(stage, us), 0, 0, width, height);
    if (isLayerShown) this.paintCells(context, stage.frame, this.layerImage!, 0.7);
    if (withNames) {
      const lit = night ? litRooms(this.run, us) : null;
      this.labels?.write(context, (room) => (lit && !lit.has(room) ? PALE_NAME : DARK_NAME));
    }
    drawScale(context, this.run.home, stage.frame, colors.value, height);
  }

  /** Say what on the plan is of another moment, and how many names there was no place for. */
  private writeFoot(context: CanvasRenderingContext2D, us: number, hidden: number, width: number, height: number): void {
    const missing = hidden === 0 ? "" : hidden === 1 ? "1 name has no place here: zoom in, or point at somebody" : `${hidden} names have no place here: zoom in, or point at somebody`;
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "right";
    context.textBaseline = "alphabetic";
    context.fillStyle = colors.value.text;
    const words = [missing, olderWords(this.run, us)].filter(Boolean).join(" · ");
    context.strokeStyle = colors.value.halo;
    context.lineWidth = 3;
    context.strokeText(words, width - 8, height - 5);
    context.fillText(words, width - 8, height - 5);
    context.textAlign = "left";
  }

  private framed(width: number, height: number): Frame {
    return Frame.fit(this.run.home, width, height, this.zoom, this.shift, this.corner);
  }

  /** Keep the body that is followed in the middle. */
  private centre(width: number, height: number): void {
    const pose = state.followed.value && this.run.tracks.get(state.followed.value)?.poseAt(state.moment.value);
    if (!pose || pose.away) return;
    this.zoom = Math.max(this.zoom, FOLLOW_ZOOM);
    this.shift = [0, 0];
    const frame = this.framed(width, height);
    this.shift = [width / 2 - frame.ux(pose.x), height / 2 - frame.uy(pose.y)];
  }

  /** Choose places for the names of rooms where no body is. */
  private placeNames(stage: Stage, poses: ReadonlyMap<string, Pose>, us: number): Box[] {
    const key = [stage.frame.key, stage.withFurniture, stage.width, stage.height].join();
    if (key !== this.labelsKey) {
      this.labelsKey = key;
      this.labels = new Labels(this.top.getContext("2d")!, this.run.home, stage.frame, stage.withFurniture);
    }
    const { run } = this;
    const { frame } = stage;
    const discs = run.bodies.map((body) => figureDisc({ run, us, poses, frame }, body));
    return this.labels!.place(discs.filter((disc) => disc !== null));
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

  /** Zoom about a pixel. */
  zoomAbout(px: number, py: number, factor: number): void {
    if (!Number.isFinite(factor) || !this.frame) return;
    const place = this.frame.place(px, py);
    this.zoom = Math.max(1, Math.min(MOST_ZOOM, this.zoom * factor));
    this.shift = [0, 0];
    if (this.zoom === 1) return;
    const frame = this.framed(this.top.clientWidth, this.top.clientHeight);
    this.shift = [px - frame.x(place[0]), py - frame.y(place[1])];
  }

  pan(dx: number, dy: number): void {
    this.shift = [this.shift[0] + dx, this.shift[1] + dy];
  }

  showWhole(): void {
    this.zoom = 1;
    this.shift = [0, 0];
  }

  /** The bodies at a pixel, the nearest first. */
  bodiesAt(px: number, py: number): string[] {
    const { frame, run } = this;
    if (!frame) return [];
    const near: [number, string][] = [];
    for (const body of run.bodies) {
      const pose = run.tracks.get(body.name)?.poseAt(state.moment.value);
      if (!pose || pose.away) continue;
      const far = Math.hypot(frame.ux(pose.x) - px, frame.uy(pose.y) - py) - bodyRadius(frame, body);
      if (far < REACH_PX) near.push([far, body.name]);
    }
    return near.sort(([one], [other]) => one - other).map(([, name]) => name);
  }

  bodyAt(px: number, py: number): string {
    return this.bodiesAt(px, py)[0] ?? "";
  }

  /** What is at a pixel, as `inspect` names it: a body, a door, or a room; of bodies, the one after the selected one. */
  thingAt(px: number, py: number): string {
    const { frame, run } = this;
    if (!frame) return "";
    const bodies = this.bodiesAt(px, py);
    if (bodies.length > 0) return bodies[(bodies.indexOf(state.selected.value) + 1) % bodies.length]!;
    const [x, y] = frame.place(px, py);
    const door = run.facts.home.doors.find((entry) => {
      const [mx, my] = [(entry.start[0] + entry.end[0]) / 2, (entry.start[1] + entry.end[1]) / 2];
      return Math.hypot(mx - x, my - y) * frame.scale < DOOR_PX;
    });
    if (door) return door.name;
    const thing = state.shown.value.has("furniture") ? run.moved.at(state.moment.value).find((entry) => isInside(entry.outline, x, y)) : undefined;
    if (thing) return thing.name;
    const room = run.home.roomAt(run.home.units(x, 0), run.home.units(y, 1));
    return room >= 0 ? run.home.roomName(room) : "";
  }

  /** What is at a pixel, with its figures, in words. */
  wordsAt(px: number, py: number): string {
    const { run } = this;
    const bodies = this.bodiesAt(px, py);
    if (bodies.length > 1) return `${bodies.length} here: ${bodies.slice(0, 12).map((name) => run.label(name)).join(", ")}${bodies.length > 12 ? ` and ${bodies.length - 12} more` : ""}`;
    const name = this.thingAt(px, py);
    if (!name) return "";
    const us = state.moment.value;
    const now = bodyState(run, name, us);
    if (now) {
      const place = run.home.roomLabel(run.home.roomIndex(now.room));
      const sees = now.sees.length > 0 ? `sees ${now.sees.join(", ")}` : "";
      return [run.label(name), place, now.activity && doing(now.activity), sees].filter(Boolean).join(" · ");
    }
    const room = run.facts.home.rooms[run.home.roomIndex(name)];
    if (room) {
      const [x, y] = this.frame!.place(px, py);
      const floor = slowFloorsAt(run, us).find((entry) => isInside(entry.outline, x, y));
      const isUnlit = run.unlitAt(us).includes(run.home.roomIndex(name));
      const isBarred = run.facts.home.no_go.some((area) => isInside(area, x, y));
      const label = run.home.labels[run.home.roomIndex(name)]!;
      return [`${label} · ${room.area_m2.toFixed(1)} m²`, isUnlit ? "light off" : "", floor?.words ?? "", isBarred ? "robots keep out" : ""].filter(Boolean).join(" · ");
    }
    const door = run.facts.home.doors.some((entry) => entry.name === name);
    return (door ? `${name} · ${run.doorOpen(name, us) ? "open" : "shut"}` : name).replaceAll("_", " ");
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
