/** Icons: strokes on a grid of 16 by 16. */

const PATHS = {
  play: "M5 3.2v9.6L12.5 8z",
  pause: "M4.6 3.4h2.2v9.2H4.6zM9.2 3.4h2.2v9.2H9.2z",
  back: "M10.5 3.5 6 8l4.5 4.5M4 3.5v9",
  on: "M5.5 3.5 10 8l-4.5 4.5M12 3.5v9",
  branch: "M4.5 3v10M4.5 9c5 0 7-1 7-4.5M11.5 4.5a1.5 1.5 0 1 0 0-3 1.5 1.5 0 0 0 0 3M4.5 14.5a1.5 1.5 0 1 0 0-3",
  check: "M3 8.5 6.5 12 13 4.5",
  cross: "M4 4l8 8M12 4l-8 8",
  eye: "M1.5 8S4 3.8 8 3.8 14.5 8 14.5 8 12 12.2 8 12.2 1.5 8 1.5 8M8 6.2a1.8 1.8 0 1 0 0 3.6 1.8 1.8 0 0 0 0-3.6",
  film: "M2.5 3.5h11v9h-11zM5 3.5v9M11 3.5v9",
  fit: "M3 6V3h3M10 3h3v3M13 10v3h-3M6 13H3v-3",
  link: "M6.5 9.5 9.5 6.5M7 4.5l1-1a3 3 0 0 1 4.5 4.5l-1 1M9 11.5l-1 1A3 3 0 0 1 3.5 8l1-1",
  search: "M7 11.5a4.5 4.5 0 1 0 0-9 4.5 4.5 0 0 0 0 9M10.4 10.4 14 14",
  theme: "M13 9.6A5.6 5.6 0 0 1 6.4 3 5.6 5.6 0 1 0 13 9.6",
} as const;

const FILLED: ReadonlySet<string> = new Set(["play", "pause"]);

export function Icon({ name, size = 16 }: { name: keyof typeof PATHS; size?: number }) {
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
