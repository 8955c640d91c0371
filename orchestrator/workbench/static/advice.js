// What the commands say, in the words of the page: fields in place of TOML and of a terminal's options.
export const TITLES = { time: "Time", u: "Torque asked for", theta_m: "Motor angle", theta_l: "Load angle" };
// Numbers that a unit may ask for, with what they mean.
export const NUMBERS = {
  torque_constant: "torque constant [N.m/A]", rated_value: "what 100 % is [N.m]", counts_per_rev: "counts per revolution",
  resistance: "resistance of the winding [ohm]", back_emf_constant: "back-EMF constant [V.s/rad]", inductance: "inductance [H]",
  rate: "samples per second", factor: "factor (-1 turns the sign)", modulo: "the counter starts again at",
  sign_bit: "one bit is the sign; its value",
};
const KEYS = { ...NUMBERS, name: "Channel", unit: "Unit in the file" };
const OPTIONS = {
  rate: "Samples per second", part: "Part [s]", resample: "Times of the rows", header: "The names are in line", test: "Test data",
  settings: "Settings", "motor-only": "leave the load encoder out", "time-limit": "Time limit [s]", design: "Propose an experiment",
};
const COLUMN = /`\[columns\.(\w+)\](?: (\w+))?(?: = ([^`]*))?`/g;
const OPTION = new RegExp(`\`?--(${Object.keys(OPTIONS).join("|")})\\b(?:[ =]([\\w.:+]+))?\`?`, "g");

const stating = (name, value) => (value && !/\.\.\./.test(value) ? `${name}: ${value.replaceAll('"', "")}` : name);

// A line of the commands as the page says it, with quotation marks in place of those of code.
export function plain(text) {
  return text.replace(/\s*\(`(--)?model`\)/g, "")
    .replace(COLUMN, (_, column, key, value) => stating(`${key ? `“${KEYS[key] ?? key}” of ` : ""}“${TITLES[column] ?? column}”`, value))
    .replace(OPTION, (_, option, value) => stating(`“${OPTIONS[option]}”`, value))
    .replace(/`([^`]*)`/g, "“$1”");
}

// What a line advises to say of a column: which, and of what; `value` where it names one.
export function adviceOf(line) {
  const [, column, key, text] = /`\[columns\.(\w+)\] (\w+) = ([^`]+)`/.exec(line ?? "") ?? [];
  if (!(column in TITLES) || !(key in NUMBERS || key === "unit")) return null;
  if (key === "unit") return { column, key, value: text === '"..."' ? undefined : text.replace(/^"(.*)"$/, "$1") };
  return { column, key, value: Number.isFinite(Number(text)) ? Number(text) : undefined };
}
