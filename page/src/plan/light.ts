/** The light of the hour: a home is bright by day; at night only rooms in which somebody is awake are. */

import type { Home } from "../data/home";
import type { Run } from "../data/run";
import { AWAY, roomOf } from "../data/rooms";
import { mix } from "../theme";
import type { Frame } from "./frame";
import { LIFT_M, WALL_M } from "./ground";

const NIGHT = "#93a1c8";
const DUSK = "#ffc48a";
const WASH = "#4f679f";
const LAMP = "#fff0cf";
/** Night is drawn at a fraction of the pixels: it has no edges but those of rooms. */
const COARSER = 3;

/** By day a room whose light is off is only a little darker than others. */
const UNLIT_BY_DAY = 0.25;

/** How bright the sky over a run is at a moment, from 0 at night to 1 by day, and how red. */
export function skyAt(run: Run, us: number): { day: number; dusk: number } {
  const { skies } = run.facts;
  const hour = run.clock.hourAt(us);
  const [darkUntil, lightFrom, lightUntil, darkFrom] = skies[Math.min(run.clock.day(us), skies.length) - 1]!;
  const rise = (from: number, to: number): number => Math.max(0, Math.min(1, (hour - from) / (to - from)));
  const near = (from: number, to: number): number => Math.max(0, 1 - Math.abs(hour - (from + to) / 2) / (0.7 * (to - from)));
  const day = rise(darkUntil, lightFrom) * (1 - rise(lightUntil, darkFrom));
  return { day, dusk: 0.5 * Math.max(near(darkUntil, lightFrom), near(lightUntil, darkFrom)) };
}

/** Rooms that are lit at a moment: by their lamps where a run has them, else those of people who are awake. */
export function litRooms(run: Run, us: number): ReadonlySet<number> {
  if (run.hasLights) {
    const unlit = new Set(run.unlitAt(us));
    return new Set([...run.facts.home.rooms.keys()].filter((room) => !unlit.has(room)));
  }
  const lit = new Set<number>();
  for (const body of run.bodies) {
    if (body.robot || run.events.last(body.name, "activity", us)?.detail === "sleep") continue;
    const track = run.tracks.get(body.name);
    const room = track && !track.empty ? roomOf(track, run.home, us) : AWAY;
    if (room !== AWAY) lit.add(room);
  }
  return lit;
}

/** How dark and how red a home is, and which rooms are lit. */
interface Lighting {
  shade: number;
  glow: number;
  lit: ReadonlySet<number>;
}

function lightingAt(run: Run, us: number): Lighting {
  const { day, dusk } = skyAt(run, us);
  const dark = Math.round(20 * (1 - day)) / 20;
  const lit = run.hasLights || dark > 0.05 ? litRooms(run, us) : new Set<number>();
  return { shade: run.hasLights ? Math.max(dark, UNLIT_BY_DAY) : dark, glow: Math.round(10 * dusk) / 10, lit };
}

/** Draws a ground in its light, anew only when that changes. */
export class Light {
  private readonly composed = document.createElement("canvas");
  private readonly veil = document.createElement("canvas");
  private drawn = "";

  /** What the light of a moment depends on. */
  key(run: Run, us: number): string {
    const { shade, glow, lit } = lightingAt(run, us);
    return [shade, glow, ...lit].join();
  }

  /** The ground in the light of a moment; `groundKey` says what is on it. */
  of(ground: HTMLCanvasElement, groundKey: string, run: Run, us: number, frame: Frame, ratio: number): HTMLCanvasElement {
    const { shade, glow, lit } = lightingAt(run, us);
    if (shade === 0 && glow === 0) return ground;
    const key = [groundKey, shade, glow, ...lit].join();
    if (key !== this.drawn) {
      this.drawn = key;
      this.compose(ground, run.home, lit, shade, glow, frame, ratio);
    }
    return this.composed;
  }

  private compose(ground: HTMLCanvasElement, home: Home, lit: ReadonlySet<number>, shade: number, dusk: number, frame: Frame, ratio: number): void {
    const { width, height } = ground;
    Object.assign(this.composed, { width, height });
    const context = this.composed.getContext("2d")!;
    context.drawImage(ground, 0, 0);
    const tint = mix(mix("#ffffff", NIGHT, shade), DUSK, 0.45 * dusk);
    this.drawVeil(home, lit, frame, ratio, width, height, tint, LAMP);
    context.globalCompositeOperation = "multiply";
    context.drawImage(this.veil, 0, 0, width, height);
    context.globalCompositeOperation = "source-over";
    this.drawVeil(home, lit, frame, ratio, width, height, WASH, null);
    context.globalAlpha = 0.34 * shade;
    context.drawImage(this.veil, 0, 0, width, height);
    context.globalAlpha = 1;
  }

  /** A colour over the whole home but its lit rooms, which have another, or none. */
  private drawVeil(home: Home, lit: ReadonlySet<number>, frame: Frame, ratio: number, width: number, height: number, color: string, lamp: string | null): void {
    Object.assign(this.veil, { width: Math.ceil(width / COARSER), height: Math.ceil(height / COARSER) });
    const context = this.veil.getContext("2d")!;
    frame.enter(context, ratio / COARSER);
    context.fillStyle = color;
    context.strokeStyle = color;
    context.lineWidth = 2 * WALL_M;
    for (const rise of [0, LIFT_M]) {
      context.save();
      context.translate(0, rise);
      for (const [outer] of home.facts.free) {
        context.beginPath();
        outer!.forEach(([x, y], i) => (i === 0 ? context.moveTo(x, y) : context.lineTo(x, y)));
        context.closePath();
        context.stroke();
        context.fill();
      }
      context.restore();
    }
    if (lamp === null) context.globalCompositeOperation = "destination-out";
    for (const room of lit) {
      const { path } = home.floors[room]!;
      context.fillStyle = lamp ?? color;
      context.fill(path);
    }
    context.globalCompositeOperation = "source-over";
  }
}
