// What the server answers; an error is thrown with the server's own line.
async function answer(response) {
  const text = await response.text();
  let found = null;
  try { found = JSON.parse(text); } catch { /* a line of words */ }
  if (!response.ok) throw new Error(found?.error ?? text.trim() ?? `the workbench answered ${response.status}`);
  return found;
}

export async function get(path) {
  return answer(await fetch(path));
}

// `last`: also where the page is closed right after.
export async function post(path, given = {}, last = false) {
  const body = JSON.stringify(given), keepalive = last && body.length < 60_000;
  return answer(await fetch(path, { method: "POST", headers: { "content-type": "application/json" }, body, keepalive }));
}

export async function upload(file) {
  try {
    return await answer(await fetch(`upload/${encodeURIComponent(file.name)}`, { method: "PUT", body: file }));
  } catch (error) {
    if (!(error instanceof TypeError)) throw error;  // the connection was cut
    throw new Error("the file was not taken: it is larger than the session allows, or the workbench has ended");
  }
}

export const fileAddress = (reference) => `file/${reference.split("/").map(encodeURIComponent).join("/")}`;
