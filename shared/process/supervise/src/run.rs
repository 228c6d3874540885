//! The run that is supervised: what all parts of the supervisor share.

use std::time::{Duration, Instant};

use gyre_transport::{
    Manifest, RunError,
    run::close_to_others,
    services::Services,
    transport::{Node, Transport},
    wake::{self, Signals},
};

use crate::{
    Event, Plan, SuperviseError, guardian::Guardian, start::Starter, wake_limit::WakeLimit,
};

/// The plan of a run, and its processes' needs for start, observation and cleanup.
pub(crate) struct Run<'a> {
    pub plan: &'a Plan,
    observe: &'a mut dyn FnMut(Event<'_>),
    pub since: Instant,
    /// Outlives the stages, which it cares for.
    pub guardian: Guardian,
    _wake_limit: Option<WakeLimit>,
    // Dropped in this order: services, node.
    pub services: Services,
    pub node: Node,
    pub transport: Transport,
    pub signals: Signals,
}

impl<'a> Run<'a> {
    /// Creates the services, which exist as long as this value.
    pub fn new(
        plan: &'a Plan,
        signals: Signals,
        observe: &'a mut dyn FnMut(Event<'_>),
    ) -> Result<Self, SuperviseError> {
        let manifest = &plan.manifest;
        let transport = manifest.transport()?;
        Transport::use_as_global(&manifest.root.join("iox.toml"))?;
        let node = transport.join("supervisor")?;
        close_to_others(&manifest.prefix)
            .map_err(|e| RunError::transport("close shared memory to other users", e))?;
        let services = Services::create(&node, &manifest.window)?;
        Ok(Self {
            plan,
            observe,
            since: Instant::now(),
            guardian: Guardian::start(&plan.guardian, &manifest.root, [])?,
            _wake_limit: plan.cpu_wake_us.map(WakeLimit::hold).transpose()?,
            services,
            node,
            transport,
            signals,
        })
    }

    pub fn manifest(&self) -> &'a Manifest {
        &self.plan.manifest
    }

    pub fn starter(&self) -> Starter<'_> {
        Starter {
            manifest: self.manifest(),
            signals: &self.signals,
            guardian: &self.guardian,
        }
    }

    pub fn say(&mut self, event: Event<'_>) {
        (self.observe)(event);
    }

    pub fn note(&mut self, sentence: &str) {
        if !sentence.is_empty() {
            self.say(Event::Note(sentence));
        }
    }

    /// Sleeps until a process ends, or `limit` has passed; true on a request to stop.
    pub fn sleep(&self, limit: Duration) -> Result<bool, SuperviseError> {
        Ok(self.signals.sleep(limit)?)
    }

    /// Lets time pass. A request to stop, or a process that dies meanwhile, is found afterwards.
    pub fn pause(&mut self, time: Duration) -> Result<(), SuperviseError> {
        let end = Instant::now() + time;
        while let Some(rest) = end.checked_duration_since(Instant::now()) {
            if self.sleep(rest.min(wake::MAX_WAIT))? {
                break;
            }
            self.say(Event::Watched);
        }
        Ok(())
    }

    /// Without room for a process it is tried again at the next wake-up.
    pub fn keep_guardian(&mut self, groups: impl Iterator<Item = u32>) {
        if self.guardian.has_ended()
            && let Ok(guardian) =
                Guardian::start(&self.plan.guardian, &self.plan.manifest.root, groups)
        {
            self.guardian = guardian;
        }
    }
}
