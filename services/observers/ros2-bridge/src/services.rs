//! The services of the bridge: each with its name, its type and its answer. Its topics are in
//! [`topics`](crate::topics).

use gyre_client::{RunError, wait_for_readable};
use gyre_ros2_messages::lifecycle_msgs::State;
use ros2_client::Message;
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::{
    commands,
    lifecycle::{self, Lifecycle},
    node::Node,
    run_state::{POLL_INTERVAL, Shared},
    wakeups::Wakeups,
};

/// A request or an answer: the library has a trait of its own for them.
#[derive(Clone, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Wire<T>(pub T);

impl<T: Serialize + DeserializeOwned> Message for Wire<T> {}

/// A request without content: it has a byte.
#[derive(Clone, Serialize, Deserialize)]
struct Empty(u8);

fn state(shared: &Shared) -> State {
    let lifecycle = shared.lifecycle.as_ref();
    lifecycle.map(Lifecycle::state).unwrap_or_default()
}

/// Answers all requests to a service, or takes all messages of a topic, that have arrived.
type Serve = Box<dyn Fn(&Shared) + Send>;

pub struct Services {
    wakeups: Wakeups,
    served: Vec<Serve>,
}

impl Services {
    /// Opens the services: those for commands, whose answers wait for a scan, and of a managed node
    /// those for its states.
    pub fn open(node: &mut Node, is_managed: bool) -> Result<Vec<Self>, RunError> {
        let mut all = vec![Self::for_commands(node)?];
        if is_managed {
            all.push(Self::for_lifecycle(node)?);
        }
        Ok(all)
    }

    fn new() -> Result<Self, RunError> {
        Ok(Self {
            wakeups: Wakeups::new()?,
            served: Vec::new(),
        })
    }

    fn for_commands(node: &mut Node) -> Result<Self, RunError> {
        let (mut services, trigger) = (Self::new()?, ["std_srvs", "Trigger"]);
        services.add(node, "reset", trigger, |shared, Empty(_)| {
            commands::reset(shared)
        })?;
        services.add(node, "new_map", trigger, |shared, Empty(_)| {
            commands::new_map(shared)
        })?;
        let poses = services.wakeups.subscribe(node, "initialpose", 1, false)?;
        services.served.push(Box::new(move |shared| {
            while let Ok(Some((message, _))) = poses.take() {
                commands::initial_pose(shared, &message).report("initialpose");
            }
        }));
        Ok(services)
    }

    fn for_lifecycle(node: &mut Node) -> Result<Self, RunError> {
        let mut services = Self::new()?;
        let of = |name| ["lifecycle_msgs", name];
        services.add(node, "change_state", of("ChangeState"), |shared, wanted| {
            let lifecycle = shared.lifecycle.as_ref();
            lifecycle.is_some_and(|it| it.change(&wanted))
        })?;
        services.add(node, "get_state", of("GetState"), |shared, Empty(_)| {
            state(shared)
        })?;
        let states = of("GetAvailableStates");
        services.add(node, "get_available_states", states, |_, Empty(_)| {
            lifecycle::states()
        })?;
        let (name, transitions) = ("get_available_transitions", of("GetAvailableTransitions"));
        services.add(node, name, transitions, |shared, Empty(_)| {
            let mut available = lifecycle::transitions();
            available.retain(|it| it.start_state == state(shared));
            available
        })?;
        services.add(node, "get_transition_graph", transitions, |_, Empty(_)| {
            lifecycle::transitions()
        })?;
        Ok(services)
    }

    /// Adds a service below the name of the node, such as `/gyre/get_state`, by its package and
    /// type.
    fn add<Q, A>(
        &mut self,
        node: &mut Node,
        name: &str,
        of: [&str; 2],
        answer: fn(&Shared, Q) -> A,
    ) -> Result<(), RunError>
    where
        Q: Serialize + DeserializeOwned + Clone + Send + 'static,
        A: Serialize + DeserializeOwned + Send + 'static,
    {
        let mut server = node.serve::<Wire<Q>, Wire<A>>(name, of)?;
        self.wakeups.add(&mut server)?;
        let name = name.to_owned();
        self.served.push(Box::new(move |shared| {
            loop {
                let answered = match server.receive_request() {
                    Ok(None) => break,
                    Ok(Some((id, Wire(request)))) => server
                        .send_response(id, Wire(answer(shared, request)))
                        .map_err(|error| format!("{error:?}")),
                    Err(error) => Err(format!("{error:?}")),
                };
                if let Err(error) = answered {
                    tracing::warn!("a request to {name} has no answer: {error}");
                }
            }
        }));
        Ok(())
    }

    /// Answers requests until the bridge stops.
    pub fn run(mut self, shared: &Shared) -> Result<(), RunError> {
        while !shared.is_stopping() {
            wait_for_readable(&self.wakeups.descriptor(), POLL_INTERVAL)?;
            self.wakeups.clear()?;
            self.served.iter().for_each(|serve| serve(shared));
        }
        Ok(())
    }
}
