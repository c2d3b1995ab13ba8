// Questions to the server that sent the page: jobs with progress.
"use strict";

async function ask(path, body) {
  const how = body === undefined ? {} : {method: "POST", body: JSON.stringify(body), headers: {"Content-Type": "application/json"}};
  const response = await fetch(path, how), found = await response.json();
  if (!response.ok) throw new Error(found.error);
  return found;
}

/** Run a job, and give its report when it is done; `shown` gets each report before. */
async function runJob(kind, body, shown) {
  let report = await ask(`jobs/${kind}`, body);
  while (report.state === "running") {
    shown(report);
    await new Promise((resolve) => setTimeout(resolve, 150));
    report = await ask(`jobs/${report.job}`);
  }
  if (report.state !== "done") throw new Error(report.error);
  return report;
}
