// The language server for YAML as an editor talks to it: over stdin and stdout.
//
//   const server = await LanguageServer.start({ "/path/schema.json": ["*.yaml"] });
//   await server.diagnose("a: 1\n");           // [{ message, source, range }]
//   await server.complete("a: 1\n¦");          // what is offered where ¦ stands
//   await server.hover("a¦: 1\n");
import { spawn } from "node:child_process";
import { createRequire } from "node:module";

const PROGRAM = createRequire(import.meta.url).resolve("yaml-language-server/bin/yaml-language-server");
const ANSWER_MS_MAX = 60_000;  // on a busy machine

export class LanguageServer {
  #process = spawn(process.execPath, [PROGRAM, "--stdio"], { stdio: ["pipe", "pipe", "inherit"] });
  #received = Buffer.alloc(0);
  #asked_count = 0;
  #answers = new Map();  // what is waited for: requests by id, diagnostics by document
  #documents_count = 0;
  #folder;
  #settings;

  // `schemas`: for which files each holds, where a file does not say so itself. Documents stand in `folder`.
  static async start(schemas = {}, folder = "/nowhere") {
    const server = new LanguageServer(schemas, folder);
    await server.#ask("initialize", {
      processId: process.pid, rootUri: null,
      capabilities: { textDocument: { completion: { completionItem: { snippetSupport: true } } }, workspace: { configuration: true } },
    });
    const configured = server.#expect("configuration", "question for the settings");
    server.#tell("initialized", {});
    server.#tell("workspace/didChangeConfiguration", { settings: { yaml: server.#settings } });
    await configured;
    await server.diagnose("{}\n");  // by then it has them
    return server;
  }

  constructor(schemas, folder) {
    this.#folder = folder;
    this.#settings = { validate: true, completion: true, hover: true, schemaStore: { enable: false }, schemas };
    this.#process.stdout.on("data", (bytes) => this.#receive(bytes));
    // It goes on its own only when it crashes.
    this.#process.on("exit", (code) => this.#answers.forEach(({ reject }) => reject(new Error(`the language server ended with ${code}`))));
  }

  stop() { this.#process.kill(); }

  diagnose(text) {
    const uri = this.#open(text);
    return this.#expect(uri, "diagnostics");
  }

  async complete(text) {
    const answer = await this.#at("completion", text);
    return answer.items ?? answer;
  }

  async hover(text) { return (await this.#at("hover", text))?.contents.value ?? ""; }

  #at(what, marked) {
    const before = marked.slice(0, marked.indexOf("¦"));
    const uri = this.#open(marked.replace("¦", ""));
    const lines = before.split("\n");
    return this.#ask(`textDocument/${what}`, { textDocument: { uri }, position: { line: lines.length - 1, character: lines.at(-1).length } });
  }

  #open(text) {
    const uri = `file://${this.#folder}/document-${++this.#documents_count}.yaml`;
    this.#tell("textDocument/didOpen", { textDocument: { uri, languageId: "yaml", version: 1, text } });
    return uri;
  }

  #expect(key, what) {
    return new Promise((resolve, reject) => {
      const timer = setTimeout(() => reject(new Error(`no ${what} within ${ANSWER_MS_MAX} ms`)), ANSWER_MS_MAX);
      const settle = (how) => (value) => { clearTimeout(timer); this.#answers.delete(key); how(value); };
      this.#answers.set(key, { resolve: settle(resolve), reject: settle(reject) });
    });
  }

  #ask(method, params) {
    const id = ++this.#asked_count;
    const answer = this.#expect(id, method);
    this.#send({ id, method, params });
    return answer;
  }

  #tell(method, params) { this.#send({ method, params }); }

  #send(message) {
    const body = Buffer.from(JSON.stringify({ jsonrpc: "2.0", ...message }));
    this.#process.stdin.write(Buffer.concat([Buffer.from(`Content-Length: ${body.length}\r\n\r\n`), body]));
  }

  #receive(bytes) {
    this.#received = Buffer.concat([this.#received, bytes]);
    for (;;) {
      const end = this.#received.indexOf("\r\n\r\n");
      if (end < 0) return;
      const length = Number(/Content-Length: (\d+)/i.exec(this.#received.subarray(0, end).toString())[1]);
      if (this.#received.length < end + 4 + length) return;
      const message = JSON.parse(this.#received.subarray(end + 4, end + 4 + length));
      this.#received = this.#received.subarray(end + 4 + length);
      this.#understand(message);
    }
  }

  #understand({ id, method, params, result, error }) {
    if (method === "textDocument/publishDiagnostics") this.#answers.get(params.uri)?.resolve(params.diagnostics);
    else if (method === "workspace/configuration") {
      this.#send({ id, result: params.items.map(({ section }) => (section === "yaml" ? this.#settings : {})) });
      this.#answers.get("configuration")?.resolve();
    }
    else if (method && id !== undefined) this.#send({ id, result: null });
    else if (error) this.#answers.get(id)?.reject(new Error(error.message));
    else if (!method) this.#answers.get(id)?.resolve(result);
  }
}
