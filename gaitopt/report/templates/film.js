// Films: slower, and picture by picture. Some browsers seek in a blob only, not in a data URI.
for (const film of document.querySelectorAll(".film")) {
  const video = film.querySelector("video"), fps = Number(video.dataset.fps);
  video.poster = film.querySelector("img").src;
  const code = atob(video.src.slice(video.src.indexOf(",") + 1));
  video.src = URL.createObjectURL(new Blob([Uint8Array.from(code, c => c.charCodeAt(0))], {type: "video/mp4"}));
  for (const button of film.querySelectorAll("[data-rate]")) button.addEventListener("click", () => {
    video.playbackRate = video.defaultPlaybackRate = Number(button.dataset.rate);
    for (const other of film.querySelectorAll("[data-rate]")) other.setAttribute("aria-pressed", other === button);
  });
  for (const button of film.querySelectorAll("[data-frames]")) button.addEventListener("click", () => {
    video.pause();
    const picture = Math.floor(video.currentTime * fps + 1e-3) + Number(button.dataset.frames);
    video.currentTime = Math.min(Math.max((picture + 0.5) / fps, 0), Math.max(0, video.duration - 0.5 / fps));
  });
}
