//! Tracking's end of the [`keeper`](super::keeper), which never waits: whom the store holds becomes known
//! here, whom it holds no more becomes unknown, and what is learnt of them goes back.

use hachi_hal::Stamp;
use hachi_people::identify::AppearanceModel;
use hachi_people::watch::Watch;
use hachi_runtime::{Receiver, Sender};
use hachi_store::people::StoredId;

use super::keeper::{News, Settled};
use super::roster::Roster;

/// From one time that a person's looks are kept to the next, s. A power cut costs what was learnt since.
const KEPT_EVERY_S: f64 = 10.0;
/// Tracking's end: who in the store is whom in view.
pub struct Acquaintances {
    /// What they look like by now.
    pub looks: Sender<(StoredId, AppearanceModel)>,
    /// Of the store.
    pub news: Receiver<News>,
    /// What became of sittings.
    pub settled: Receiver<Settled>,
    /// When looks were last sent.
    pub kept_at: Option<Stamp>,
}

impl Acquaintances {
    /// Takes in what changed in the store.
    pub fn hear(&mut self, watch: &mut Watch, roster: &mut Roster) {
        while let Some(news) = self.news.receive() {
            match news {
                News::Known(id, model) => {
                    let person = watch.identifier().enrol(model, None);
                    roster.add(person, Some(id));
                }
                News::Forgotten(gone) => {
                    if let Some(person) = roster.forget(gone) {
                        watch.identifier().forget(person);
                    }
                }
            }
        }
    }

    /// Has the looks of everybody in view kept, from time to time.
    pub fn tell(&mut self, watch: &Watch, roster: &Roster, now: Stamp) {
        let kept_at = *self.kept_at.get_or_insert(now);
        if now.secs_since(kept_at) < KEPT_EVERY_S {
            return;
        }
        self.kept_at = Some(now);
        let in_view = watch.statuses().filter(|status| status.unseen_s == 0.0);
        for status in in_view {
            let stored = roster.of(status.person).and_then(|known| known.stored);
            if let (Some(id), Some(model)) = (stored, watch.model(status.person)) {
                // The oldest one goes where the keeper is behind: only the newest counts.
                let _ = self.looks.send((id, model.clone()));
            }
        }
    }
}
