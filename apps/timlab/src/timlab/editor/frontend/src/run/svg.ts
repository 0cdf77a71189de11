/** A sheet on which pictures are drawn as on a canvas, and which is an SVG in the end. It knows what they use of it. */
export class SvgContext {
  fillStyle = "#000";
  strokeStyle = "#000";
  lineWidth = 1;
  globalAlpha = 1;
  font = "11px sans-serif";
  textAlign = "start";
  private path = "";
  private dash: number[] = [];
  private readonly parts: string[] = [];
  private readonly kept: Partial<SvgContext>[] = [];
  private clips = 0;
  private open = 0;

  constructor(
    private readonly width: number,
    private readonly height: number,
  ) {}

  beginPath(): void {
    this.path = "";
  }
  moveTo(x: number, y: number): void {
    this.path += `M${short(x)} ${short(y)}`;
  }
  lineTo(x: number, y: number): void {
    this.path += `L${short(x)} ${short(y)}`;
  }
  closePath(): void {
    this.path += "Z";
  }
  rect(x: number, y: number, width: number, height: number): void {
    this.path += `M${short(x)} ${short(y)}h${short(width)}v${short(height)}h${short(-width)}Z`;
  }
  arc(x: number, y: number, radius: number): void {
    this.ellipse(x, y, radius, radius);
  }
  ellipse(x: number, y: number, across: number, up: number): void {
    const half = `a${short(across)} ${short(up)} 0 1 0`;
    this.path += `M${short(x - across)} ${short(y)}${half} ${short(2 * across)} 0${half} ${short(-2 * across)} 0`;
  }
  stroke(): void {
    this.add(`<path d="${this.path}" fill="none" ${this.pen()}/>`);
  }
  fill(): void {
    this.add(`<path d="${this.path}" fill="${this.fillStyle}" opacity="${this.globalAlpha}"/>`);
  }
  fillRect(x: number, y: number, width: number, height: number): void {
    const [left, top] = [Math.min(x, x + width), Math.min(y, y + height)];
    const size = `width="${short(Math.abs(width))}" height="${short(Math.abs(height))}"`;
    this.add(
      `<rect x="${short(left)}" y="${short(top)}" ${size} fill="${this.fillStyle}" opacity="${this.globalAlpha}"/>`,
    );
  }
  strokeRect(x: number, y: number, width: number, height: number): void {
    this.add(`<path d="M${short(x)} ${short(y)}l${short(width)} ${short(height)}" fill="none" ${this.pen()}/>`);
  }
  fillText(text: string, x: number, y: number): void {
    this.write(text, x, y, "");
  }
  /** A text that is read from below. */
  fillTextUpwards(text: string, x: number, y: number): void {
    this.write(text, x, y, ` transform="rotate(-90 ${short(x)} ${short(y)})"`);
  }
  setLineDash(dash: number[]): void {
    this.dash = dash;
  }
  save(): void {
    const { fillStyle, strokeStyle, lineWidth, globalAlpha } = this;
    this.kept.push({ fillStyle, strokeStyle, lineWidth, globalAlpha });
  }
  clip(): void {
    this.clips += 1;
    this.open += 1;
    this.parts.push(`<clipPath id="clip${this.clips}"><path d="${this.path}"/></clipPath>`);
    this.parts.push(`<g clip-path="url(#clip${this.clips})">`);
  }
  restore(): void {
    Object.assign(this, this.kept.pop());
    for (; this.open > 0; this.open -= 1) this.parts.push("</g>");
  }

  /** The whole picture. */
  text(background: string): string {
    const size = `width="${this.width}" height="${this.height}"`;
    return (
      `<svg xmlns="http://www.w3.org/2000/svg" ${size} viewBox="0 0 ${this.width} ${this.height}">` +
      `<rect ${size} fill="${background}"/>${this.parts.join("")}</svg>\n`
    );
  }

  private pen(): string {
    const dash = this.dash.length ? ` stroke-dasharray="${this.dash.join(" ")}"` : "";
    return `stroke="${this.strokeStyle}" stroke-width="${this.lineWidth}" opacity="${this.globalAlpha}"${dash}`;
  }

  private write(text: string, x: number, y: number, more: string): void {
    const [size = "11px"] = this.font.match(/[\d.]+px/) ?? [];
    const weight = /bold|600/.test(this.font) ? ' font-weight="600"' : "";
    const anchor = { right: "end", center: "middle" }[this.textAlign] ?? "start";
    const look = `font-family="sans-serif" font-size="${size}" text-anchor="${anchor}" fill="${this.fillStyle}"${weight}`;
    this.add(`<text x="${short(x)}" y="${short(y)}" ${look}${more}>${escaped(text)}</text>`);
  }

  private add(part: string): void {
    this.parts.push(part);
  }
}

const short = (x: number): number => Math.round(100 * x) / 100;

export const escaped = (text: string): string =>
  text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;").replaceAll('"', "&quot;");
