"""The rules of what is run: a stage per probe, and `run` for what may happen in any of them.

See ``rules`` for the columns.
"""

DYNAMIC = """
[run]
limits.time | E | * | - | no call takes longer than the time limit | look for an endless loop; raise the limit for a slow model
limits.memory | E | * | - | memory stays below the memory limit | look for a leak; raise the limit for a large model
limits.output | E | * | - | printed text and files stay small | print only when logging is on
run.crash | E | * | - | no call ends the process | run the call named under a debugger
run.failed | E | * | - | the checks can be carried out | report this with the FMU
run.not-executed | E | * | * | the FMU is executed, unless that is not asked for | check it where its binaries run, or ask for the static checks only
run.skipped | I | * | - | all checks can be carried out | mend the other findings first

[load]
load.library | E | 2.3 | - | the library loads | see the loader's message; link what is missing
load.version | E | 2.1.4 | - | fmi2GetVersion returns 2.0 | return fmi2Version
load.platform | E | 2.1.4 | - | fmi2GetTypesPlatform returns default | return fmi2TypesPlatform

[life cycle]
run.instantiate | E | 2.1.5 | - | fmi2Instantiate succeeds | see the messages of the FMU
run.status | E | 4.2.4 | - | every call of a normal life cycle returns fmi2OK or fmi2Warning | see the messages of the FMU
run.pending | E | 4.2.2 | - | fmi2Pending only with canRunAsynchronuously | return when the step is done, or set the flag
run.warning | W | 2.1.3 | - | calls of a normal life cycle return fmi2OK, not fmi2Warning | see the message; every host goes on after it, and not every host shows it
run.logged-error | W | 2.1.3 | - | what is logged as an error comes with a status of an error | return fmi2Error, or log it as a warning
value.not-finite | E | 2.2.7 | - | outputs are finite | look for a division by zero or a missing initialisation
value.out-of-range | W | 2.2.7 | - | outputs stay within min and max | correct the bounds or the model
value.start | W | 2.2.7 | - | start values of the XML are those of the binary | generate both from one source
value.string | E | 2.1.7 | - | strings are not null | return "" instead

[inputs]
run.input-refused | W | 2.1.7 | - | inputs within their bounds are accepted | state the bounds in min and max

[setting]
value.set | E | 2.1.7 | - | start values can be set before initialisation, and change nothing | accept what the XML says can be set
value.set-initial | W | 2.1.7 | - | variables with initial exact accept their start value before initialisation | accept it, or write initial="calculated"

[instances]
instances.second | E | 2.1.5 | - | a second instance can be made | set canBeInstantiatedOnlyOncePerProcess, or remove global state
instances.interference | E | 2.1.5 | - | instances do not influence one another | move global variables into the instance

[reset]
run.reset | E | 2.1.6 | - | fmi2Reset returns the instance to its first state | restore every variable, hidden ones too

[determinism]
run.inexact | W | * | - | runs that must be equal are so bit for bit, not only to a thousandth of the range | save and reset the memory of the solver too
run.determinism | W | * | - | two equal runs are equal | seed random numbers, initialise memory

[state]
state.status | E | 2.1.8 | - | the state functions work as the flags promise | implement them, or clear the flag
state.restore | E | 2.1.8 | - | a restored state continues as before | save every variable, hidden ones too, by value
state.serialise | E | 2.1.8 | - | a serialised state continues as before, also in a new instance | serialise every variable, no pointers
state.free | W | 2.1.8 | - | fmi2FreeFMUstate sets the state to null | set the pointer to NULL

[variable steps]
steps.variable | W | 4.3.1 | - | results hardly depend on the communication step | integrate over the step given, or clear canHandleVariableCommunicationStepSize

[reference]
reference.result | E | * | - | the reference result is reproduced | correct the model, or write the reference again
reference.not-run | I | * | - | the reference result can be reproduced in reasonable time | shorten the result

[misuse]
misuse.guid | W | 2.1.5 | - | a wrong guid is refused | compare the guid in fmi2Instantiate
misuse.crash | W | * | - | misuse does not end the process | check the arguments and the state of the instance
misuse.step-before-init | W | 4.2.4 | - | fmi2DoStep before initialisation is refused | return fmi2Error
misuse.negative-step | W | 4.2.4 | - | a negative step is refused | return fmi2Error or fmi2Discard
misuse.value-reference | W | 2.1.7 | - | unknown value references are refused | return fmi2Error

[memory]
resources.instance-leak | W | * | - | memory does not grow with instances made and freed | free what is allocated in fmi2Instantiate
resources.step-leak | W | * | - | memory does not grow with steps | free what is allocated in fmi2DoStep

[afterwards]
files.written | W | * | - | the FMU writes no files of its own | write only where a parameter says so
files.changed | W | * | - | the FMU leaves its own files alone | write to a temporary folder
process.left | W | * | - | no process outlives the FMU | end child processes in fmi2FreeInstance
"""  # noqa: E501
