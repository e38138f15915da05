/** Colours of what is drawn on canvases, in light and in dark. */

import { computed, effect, signal } from "@preact/signals";
import { theme } from "./state";

export interface Colors {
  ground: string;
  panel: string;
  text: string;
  quiet: string;
  line: string;
  wall: string;
  door: string;
  view: string;
  viewEdge: string;
  alarm: string;
  cursor: string;
  halo: string;
  hatch: string;
  slow: string;
  shadow: string;
  /** How much people move, in the overview. */
  bars: string;
  /** What a home stands on. */
  stage: string;
}

const LIGHT: Colors = {
  ground: "#ffffff",
  panel: "#f6f7f8",
  text: "#2d3138",
  quiet: "#5d626a",
  line: "#d5d8dc",
  wall: "#3b4048",
  door: "#8a5a2b",
  view: "#0e9e9a",
  viewEdge: "#0b7d7a",
  alarm: "#c8452f",
  cursor: "#0a7470",
  halo: "rgba(255,255,255,0.8)",
  hatch: "#cfd2d6",
  slow: "#0077bb",
  shadow: "rgba(70, 60, 45, 0.28)",
  bars: "#9a9fa8",
  stage: "#f1ede5",
};

const DARK: Colors = {
  ground: "#16181c",
  panel: "#1e2126",
  text: "#e6e8eb",
  quiet: "#a4a9b1",
  line: "#3a3f47",
  wall: "#aab0b9",
  door: "#d49a5c",
  view: "#5ae1d7",
  viewEdge: "#6ff0e6",
  alarm: "#ff7a63",
  cursor: "#3cc7c0",
  halo: "rgba(22,24,28,0.8)",
  hatch: "#4a5059",
  slow: "#66bbee",
  shadow: "rgba(0, 0, 0, 0.65)",
  bars: "#6a727d",
  stage: "#191d22",
};

const query = typeof matchMedia === "function" ? matchMedia("(prefers-color-scheme: dark)") : null;
const preferred = signal(query?.matches ?? false);
query?.addEventListener("change", (event) => {
  preferred.value = event.matches;
});

export const dark = computed(() => (theme.value === "auto" ? preferred.value : theme.value === "dark"));
export const colors = computed(() => (dark.value ? DARK : LIGHT));

export function followTheme(): void {
  effect(() => {
    document.documentElement.dataset.theme = dark.value ? "dark" : "light";
  });
}

/** Colours of words and lines, distinct with any kind of colour blindness (Paul Tol's muted scheme). */
export const PALETTE = ["#88ccee", "#ddcc77", "#cc6677", "#44aa99", "#aa4499", "#999933", "#332288", "#117733", "#882255"];
/** What each camera of a robot but the first has in view. */
const CAMERA_COLORS = ["#bbbbbb", "#33bbee", "#ee7733"];

/** The colour of the region that a camera sees, by the camera's number, and of its edge. */
export function cameraColors(number: number, { view, viewEdge }: Colors): [string, string] {
  const color = CAMERA_COLORS[number % CAMERA_COLORS.length]!;
  return number === 0 ? [view, viewEdge] : [color, mix(color, "#000000", 0.3)];
}

type Rgb = [number, number, number];

export function rgb(color: string): Rgb {
  return [1, 3, 5].map((at) => Number.parseInt(color.slice(at, at + 2), 16)) as Rgb;
}

/** A colour between two, as `#rrggbb`: 0 is the first. */
export function mix(one: string, other: string, share: number): string {
  const [a, b] = [rgb(one), rgb(other)];
  const parts = a.map((part, i) => Math.round(part + (b[i]! - part) * share));
  return `#${parts.map((part) => part.toString(16).padStart(2, "0")).join("")}`;
}

/** A body's colour, legible on the ground: dark ones are lighter in the dark. */
export function bodyColor(color: string, inDark = dark.value): string {
  if (!inDark) return color;
  const [red, green, blue] = rgb(color);
  const bright = 0.3 * red + 0.59 * green + 0.11 * blue;
  return bright < 110 ? mix(color, "#ffffff", 0.55) : color;
}

/** A body's colour below white words. */
export function pillColor(color: string): string {
  return mix(color, "#000000", 0.08);
}

/** A room's colour on the plan. */
export function roomColor(pale: string, deep: string, inDark = dark.value): string {
  return inDark ? mix(deep, DARK.ground, 0.72) : pale;
}

/** The brighter part of viridis: words are legible over it. */
const SCALE = ["#2c728e", "#21918c", "#27ad81", "#5ec962", "#aadc32", "#fde725"];

/** The colour of a value between 0 and 1. */
export function scaleColor(share: number): Rgb {
  const at = Math.max(0, Math.min(1, share)) * (SCALE.length - 1);
  const i = Math.min(SCALE.length - 2, Math.floor(at));
  const [a, b] = [rgb(SCALE[i]!), rgb(SCALE[i + 1]!)];
  return a.map((part, k) => Math.round(part + (b[k]! - part) * (at - i))) as Rgb;
}
