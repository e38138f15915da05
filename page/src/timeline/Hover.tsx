/** What is under the pointer on a calendar or a timeline, with the home at that moment. */

import { effect, signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Run } from "../data/run";
import { onePerFrame } from "../plan/canvas";
import { drawThumbnail, THUMBNAIL } from "../plan/thumbnail";

export interface Hovered {
  words: string;
  us: number;
  /** Where the pointer is in the window [px]. */
  x: number;
  y: number;
}

const WIDE_PX = 190;
const AWAY_PX = 12;

export function Hover({ run, at }: { run: Run; at: Hovered | null }) {
  if (!at) return null;
  const isLeft = at.x + AWAY_PX + WIDE_PX > window.innerWidth;
  const left = Math.max(4, isLeft ? at.x - AWAY_PX - WIDE_PX : at.x + AWAY_PX);
  // Calendars and timelines are at the foot of the window: there is more room above the pointer.
  return (
    <output class="hover with-home" aria-live="off" style={{ left: `${left}px`, bottom: `${window.innerHeight - at.y + AWAY_PX}px` }}>
      <Thumbnail run={run} us={at.us} />
      {at.words}
    </output>
  );
}

/** The home at a moment, as a small picture. */
export function Thumbnail({ run, us, focus = "" }: { run: Run; us: number; focus?: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const wanted = useRef(signal({ us, focus }));
  wanted.current.value = { us, focus };
  useEffect(() => {
    const paint = onePerFrame(() => {
      if (canvas.current) drawThumbnail(canvas.current, run, wanted.current.value.us, wanted.current.value.focus);
    });
    // Small pictures wait until the large one is there.
    return effect(() => {
      void wanted.current.value;
      if (run.isRead.value) paint();
    });
  }, [run]);
  return <canvas ref={canvas} class="thumbnail" width={THUMBNAIL.width * 2} height={THUMBNAIL.height * 2} aria-hidden="true" />;
}
