/**
 * The grammar of questions. A word may be part of the grammar or a name, as of somebody called "seen": of all ways
 * to read a question that use up its words, the first one counts. A name in quotes is nothing but a name.
 */

import type { Names } from "./names";

/** Names that belong together: what is asked holds of all of them at the same time, or of any. */
export interface Group {
  names: readonly string[];
  any: boolean;
}

export type Clause =
  | { kind: "rooms"; who: Group; rooms: ReadonlySet<number>; isNot: boolean }
  | { kind: "seen"; who: Group | null; by: Group | null; isNot: boolean }
  | { kind: "differs"; who: Group | null };

export interface Token {
  /** As it was typed. */
  text: string;
  isQuoted: boolean;
}

/** Words that carry no meaning of their own. */
export const FILLERS = new Set(["in", "the", "is", "are", "was", "were", "of", "does", "did", "at", "on", "a", "both"]);
const JOINERS = new Set(["and", "or", ",", "by"]);

export function tokensOf(question: string): Token[] {
  const tokens = question.replaceAll(/,(?=\s|$)/g, " , ").matchAll(/"([^"]*)"|\S+/g);
  return Array.from(tokens, ([text, quoted]) => ({ text: quoted ?? text, isQuoted: quoted !== undefined }));
}

export function textOf(tokens: readonly Token[]): string {
  return tokens.map((token) => token.text).join(" ");
}

/** Whether a token is one of some words of the grammar. */
export function isWord(token: Token | undefined, words: ReadonlySet<string>): boolean {
  return token !== undefined && !token.isQuoted && words.has(token.text.toLowerCase());
}

/** What was read, and the index of the token after it. */
type Found<T> = Iterable<[T, number]>;
type Rule<T> = (at: number) => Found<T>;

class Reader {
  constructor(
    private readonly tokens: readonly Token[],
    private readonly names: Names,
  ) {}

  private is(at: number, ...words: string[]): boolean {
    return isWord(this.tokens[at], new Set(words));
  }

  private get end(): number {
    return this.tokens.length;
  }

  /** The longest name first. */
  private *name<T>(at: number, find: (text: string) => T | undefined): Found<T> {
    for (let end = this.end; end > at; end--) {
      const found = find(textOf(this.tokens.slice(at, end)));
      if (found !== undefined) yield [found, end];
    }
    if (isWord(this.tokens[at], FILLERS)) yield* this.name(at + 1, find);
  }

  readonly body: Rule<string> = (at) => this.name(at, (text) => this.names.body(text));
  private readonly room: Rule<ReadonlySet<number>> = (at) => this.name(at, (text) => this.names.room(text));

  /** Items with `and`, `or`, commas or nothing between them: all `and` or all `or`. */
  *list<T>(rule: Rule<T>, at: number, before: readonly T[] = [], joiner = ""): Found<{ items: T[]; any: boolean }> {
    for (const [item, next] of rule(at)) {
      const items = [...before, item];
      const comma = this.is(next, ",") ? next + 1 : next;
      for (const word of ["and", "or"]) {
        if (this.is(comma, word) && (joiner === "" || joiner === word)) yield* this.list(rule, comma + 1, items, word);
      }
      if (comma > next) yield* this.list(rule, comma, items, joiner);
      yield [{ items, any: joiner === "or" }, next];
      yield* this.list(rule, next, items, joiner); // after all that a word between names may mean
    }
  }

  /** The names of one body or more; nothing, too, where it isn't needed. */
  private *group(at: number): Found<Group> {
    for (const [{ items, any }, next] of this.list(this.body, at)) yield [{ names: items, any }, next];
  }

  private *optionalGroup(at: number): Found<Group | null> {
    yield [null, at];
    yield* this.group(at);
  }

  /** As many words without a meaning as there are, or fewer; and whether `not` is among them. */
  private *gap(at: number, isNot = false): Found<boolean> {
    if (isWord(this.tokens[at], FILLERS)) yield* this.gap(at + 1, isNot);
    if (this.is(at, "not") && !isNot) yield* this.gap(at + 1, true);
    yield [isNot, at];
  }

  /** `ana and ben not in the kitchen` */
  private *inRooms(): Found<Clause> {
    for (const [isNotFirst, begin] of this.gap(0))
      for (const [who, next] of this.group(begin))
        for (const [isNot, place] of this.gap(next, isNotFirst))
          for (const [{ items }, end] of this.list(this.room, place)) {
            const rooms = new Set(items.flatMap((item) => [...item]));
            yield [{ kind: "rooms", who, rooms, isNot }, end];
          }
  }

  /** `seen ana by astro`, `ana not seen` */
  private *seen(): Found<Clause> {
    for (const [isNotFirst, begin] of this.gap(0))
      for (const [before, next] of this.optionalGroup(begin))
        for (const [isNot, at] of this.gap(next, isNotFirst)) {
          if (!this.is(at, "seen")) continue;
          const whoms: Found<Group | null> = before ? [[before, at + 1]] : this.optionalGroup(at + 1);
          for (const [who, after] of whoms) {
            if (this.is(after, "by")) for (const [by, end] of this.group(after + 1)) yield [{ kind: "seen", who, by, isNot }, end];
            yield [{ kind: "seen", who, by: null, isNot }, after];
          }
        }
  }

  /** `astro sees ana` */
  private *sees(): Found<Clause> {
    for (const [by, next] of this.group(0))
      for (const [isNot, at] of this.gap(next)) {
        if (!this.is(at, "sees", "see", "saw")) continue;
        for (const [who, end] of this.optionalGroup(at + 1)) yield [{ kind: "seen", who, by, isNot }, end];
      }
  }

  private *differs(): Found<Clause> {
    for (const [who, at] of this.optionalGroup(0)) if (this.is(at, "differs", "differ")) yield [{ kind: "differs", who }, at + 1];
  }

  clause(): Clause | null {
    for (const rule of [this.inRooms(), this.seen(), this.sees(), this.differs()])
      for (const [clause, end] of rule) if (end === this.end) return clause;
    return null;
  }

  /** The bodies or the rooms that all tokens name; null: they name neither. */
  subject(): { bodies: string[] } | { rooms: ReadonlySet<number> } | null {
    for (const [{ items }, end] of this.list(this.body, 0)) if (end === this.end) return { bodies: items };
    for (const [{ items }, end] of this.list(this.room, 0)) if (end === this.end) return { rooms: new Set(items.flatMap((item) => [...item])) };
    return null;
  }

  /** What stands for a room in `ana in ROOM`, where it is none. */
  wrongRoom(): string {
    for (const [, next] of this.group(0))
      for (const [, at] of this.gap(next)) if (at > next && at < this.end && this.is(at - 1, "in")) return textOf(this.tokens.slice(at));
    return "";
  }
}

export function clauseOf(tokens: readonly Token[], names: Names): Clause | null {
  return new Reader(tokens, names).clause();
}

export function subjectOf(tokens: readonly Token[], names: Names): ReturnType<Reader["subject"]> {
  return new Reader(tokens, names).subject();
}

export function wrongRoomOf(tokens: readonly Token[], names: Names): string {
  return new Reader(tokens, names).wrongRoom();
}

/** The tokens without those that carry no meaning. */
export function meaningful(tokens: readonly Token[]): Token[] {
  return tokens.filter((token) => !isWord(token, FILLERS) && !isWord(token, JOINERS));
}
