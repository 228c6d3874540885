//! The bridge: a node that publishes the runs of a folder.

use std::{panic::resume_unwind, thread};

use gyre_client::{RunError, Signals, clock};

use crate::{
    Settings,
    following::follow_runs,
    health::report,
    lifecycle::Lifecycle,
    node::{Keep, Node},
    run_state::{POLL_INTERVAL, Shared},
    services::Services,
    topics::Topics,
};

/// Transitions that are kept for slow readers.
const TRANSITIONS: Keep = Keep::Last(10);

pub struct Bridge {
    shared: Shared,
    topics: Topics,
    /// Each on a thread of its own: the answer to a command waits for a scan.
    services: Vec<Services>,
    /// Dropped last: it owns the topics.
    _node: Node,
}

impl Bridge {
    pub fn open(settings: Settings) -> Result<Self, RunError> {
        let mut node = Node::new(&settings.domain, &settings.namespace, &settings.name)?;
        let events = node.below("transition_event");
        let events = node.publish_if(settings.is_managed, &events, TRANSITIONS)?;
        Ok(Self {
            topics: Topics::open(&mut node, &settings)?,
            services: Services::open(&mut node, settings.is_managed)?,
            shared: Shared::new(settings, events.map(Lifecycle::new)),
            _node: node,
        })
    }

    /// Publishes until a signal arrives.
    pub fn publish(mut self, signals: &Signals) -> Result<(), RunError> {
        let (shared, services, topics) = (&self.shared, self.services, self.topics.of_run);
        let mounted = shared.settings.vehicle.mounted(clock::since_1970_ns());
        self.topics.mounting.send(mounted);
        thread::scope(|threads| {
            // Their end by an error ends the bridge.
            let serve = |services: Services| {
                threads.spawn(move || services.run(shared).inspect_err(|_| shared.stop()))
            };
            let served: Vec<_> = services.into_iter().map(serve).collect();
            threads.spawn(|| follow_runs(shared, topics));
            threads.spawn(|| report(shared, self.topics.diagnostics));
            let mut stopped = Ok(false);
            while let Ok(false) = stopped
                && !shared.is_stopping()
            {
                stopped = signals.sleep(POLL_INTERVAL);
            }
            shared.stop();
            let ended = served.into_iter().map(|it| it.join());
            let ended = ended.map(|it| it.unwrap_or_else(|panic| resume_unwind(panic)));
            ended.fold(stopped.map(drop), Result::and)
        })
    }
}
