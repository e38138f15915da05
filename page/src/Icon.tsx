/** Icons: strokes on a grid of 16 by 16. */

export const PATHS = {
  play: "M5 3.2v9.6L12.5 8z",
  pause: "M4.6 3.4h2.2v9.2H4.6zM9.2 3.4h2.2v9.2H9.2z",
  back: "M10.5 3.5 6 8l4.5 4.5M4 3.5v9",
  on: "M5.5 3.5 10 8l-4.5 4.5M12 3.5v9",
  bag: "M3 6h10l.6 8H2.4zM5.5 6V4.5a2.5 2.5 0 0 1 5 0V6",
  ball: "M8 2.2a5.8 5.8 0 1 0 0 11.6A5.8 5.8 0 0 0 8 2.2M3 5.5c3 2 7 2 10 0M3 10.5c3-2 7-2 10 0",
  bell: "M2 6v4M4.2 4.5v7M11.8 4.5v7M14 6v4M4.2 8h7.6",
  book: "M8 4C6 2.6 3.5 3 2 3.4v9.2c1.5-.4 4-.8 6 .6 2-1.4 4.5-1 6-.6V3.4C12.5 3 10 2.6 8 4v9",
  box: "M2.5 5 8 2l5.5 3v6L8 14l-5.5-3zM2.5 5 8 8l5.5-3M8 8v6",
  branch: "M4.5 3v10M4.5 9c5 0 7-1 7-4.5M11.5 4.5a1.5 1.5 0 1 0 0-3 1.5 1.5 0 0 0 0 3M4.5 14.5a1.5 1.5 0 1 0 0-3",
  check: "M3 8.5 6.5 12 13 4.5",
  cross: "M4 4l8 8M12 4l-8 8",
  cup: "M3 5h8v4.5A3 3 0 0 1 8 12.5H6A3 3 0 0 1 3 9.5zM11 6h1.2a1.6 1.6 0 0 1 0 3.5H11M5.5 1.8v1.4M8.5 1.8v1.4",
  dot: "M8 7a1 1 0 1 0 0 2 1 1 0 0 0 0-2",
  drop: "M8 2s4 4.5 4 7.5a4 4 0 0 1-8 0C4 6.5 8 2 8 2",
  eye: "M1.5 8S4 3.8 8 3.8 14.5 8 14.5 8 12 12.2 8 12.2 1.5 8 1.5 8M8 6.2a1.8 1.8 0 1 0 0 3.6 1.8 1.8 0 0 0 0-3.6",
  film: "M2.5 3.5h11v9h-11zM5 3.5v9M11 3.5v9",
  fit: "M3 6V3h3M10 3h3v3M13 10v3h-3M6 13H3v-3",
  fork: "M5 2v12M3 2v3.5a2 2 0 0 0 4 0V2M11.5 2v12M11.5 2c2 1.5 2 5 0 6.5",
  laptop: "M3.5 3.5h9V10h-9zM1.5 12.5h13",
  link: "M6.5 9.5 9.5 6.5M7 4.5l1-1a3 3 0 0 1 4.5 4.5l-1 1M9 11.5l-1 1A3 3 0 0 1 3.5 8l1-1",
  moon: "M13 9.6A5.6 5.6 0 0 1 6.4 3 5.6 5.6 0 1 0 13 9.6",
  pan: "M2 7h8v2.5A2.5 2.5 0 0 1 7.5 12h-3A2.5 2.5 0 0 1 2 9.5zM10 8h4.5",
  phone: "M5 1.8h6v12.4H5zM7.5 12h1",
  robot: "M3 6.5h10v6H3zM8 6.5v-3M8 3.5a1 1 0 1 0 0-2 1 1 0 0 0 0 2M6 9v1M10 9v1",
  search: "M7 11.5a4.5 4.5 0 1 0 0-9 4.5 4.5 0 0 0 0 9M10.4 10.4 14 14",
  shirt: "M5.5 2.5 2 5l1.5 2.5L5 6.8V13.5h6V6.8l1.5.7L14 5l-3.5-2.5C9.5 4 6.5 4 5.5 2.5",
  shower: "M3 14V4a2 2 0 0 1 4 0M4.8 6h4.4M6 8.5v1M8 8.5v1M6 11v1M8 11v1",
  sofa: "M3.5 7V4.5h9V7M2 7v5h12V7M4 9.5h8M4 12v1.5M12 12v1.5",
  theme: "M13 9.6A5.6 5.6 0 0 1 6.4 3 5.6 5.6 0 1 0 13 9.6",
  tv: "M2 3.5h12V11H2zM5.5 13.5h5",
} as const;

const FILLED: ReadonlySet<string> = new Set(["play", "pause"]);

export type IconName = keyof typeof PATHS;

export function Icon({ name, size = 16 }: { name: IconName; size?: number }) {
  const isFilled = FILLED.has(name);
  return (
    <svg
      class="icon"
      width={size}
      height={size}
      viewBox="0 0 16 16"
      aria-hidden="true"
      fill={isFilled ? "currentColor" : "none"}
      stroke={isFilled ? "none" : "currentColor"}
      stroke-width="1.5"
      stroke-linecap="round"
      stroke-linejoin="round"
    >
      <path d={PATHS[name]} />
    </svg>
  );
}
