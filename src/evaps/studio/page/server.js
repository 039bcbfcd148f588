// Asking the studio's server.

const GONE = "the studio does not answer; is `evaps studio` still running?";

/** A reply; what the server refuses, and that it is gone, are errors to be shown. */
export async function ask(path, body) {
  const options = body === undefined ? {} : {
    method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
  let reply;
  try {
    reply = await fetch(path, options);
  } catch {
    throw new Error(GONE);
  }
  if (!reply.ok) throw new Error((await reply.json().catch(() => ({}))).error ?? `error ${reply.status}`);
  return reply;
}

export const askJson = async (path, body) => (await ask(path, body)).json();

/** The JSON values of a reply that comes line by line. */
export async function* linesOf(reply) {
  const reader = reply.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { value, done } = await reader.read().catch(() => { throw new Error(GONE); });
    if (done) return;
    const lines = (rest + value).split("\n");
    rest = lines.pop();
    for (const line of lines) yield JSON.parse(line);
  }
}
