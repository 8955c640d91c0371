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

// Send a file; `tell` is called with the share that is sent.
export function upload(file, tell = () => {}) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("PUT", `upload/${encodeURIComponent(file.name)}`);
    request.upload.onprogress = (event) => event.lengthComputable && tell(event.loaded / event.total);
    request.onload = () => {
      let found = null;
      try { found = JSON.parse(request.responseText); } catch { /* a line of words */ }
      if (request.status === 201) resolve(found);
      else reject(new Error(found?.error ?? (request.responseText.trim() || "the file was not taken")));
    };
    request.onerror = () => reject(new Error("the file was not taken: it is larger than the session allows, or the workbench has ended"));
    request.send(file);
  });
}

export const fileAddress = (reference) => `file/${reference.split("/").map(encodeURIComponent).join("/")}`;
