"""Every word that the console's pages say, in one place, so that it can be translated.

What a study's own protocol and questionnaires say stands in those. ``{names}`` are filled in.
"""

import sys
from types import ModuleType
from typing import Any, Final

from steerlab.sim.language import said

LANGUAGE: Final = "en"

# For participants: frame and way
STEP_OF = "Step {step} of {steps}"
ANSWERED_OF = "{answered} of {items} answered"
PART_OF = "Part {part} of {parts}"
SKIP = "Skip to the content"

# Consent
CONSENT_QUESTION = "Do you want to take part?"
CONSENT_YES = "Yes, I agree to take part"
CONSENT_NO = "No, I do not want to take part"
CONSENT_VERSION = "Version {version} of this information"
CONSENT_TICKS = (
    "Please tick each statement that you agree with. You can take part only if you agree with all."
)
CONSENT_TICK_MISSING = "To take part, please tick this statement."
CONSENT_AGE = "How old are you?"
CONSENT_OF_AGE = "I am {age} years old or older"
CONSENT_TOO_YOUNG = "I am younger than {age}"
CONSENT_AGE_MISSING = "To take part, please say how old you are."
CONSENT_SIGNATURE = "Your name, as your signature"
CONSENT_SIGNATURE_NOTE = (
    "It is shown on your own copy, right after this page, and is not kept with the study."
)
CONSENT_SIGNATURE_MISSING = "To take part, please type your name."
CONSENT_LACKING = "To take part, please look at what is marked below."
COPY_LINK = "Your copy of the information and consent"
COPY_TITLE = "Information and consent: your copy"
COPY_GIVEN = "Agreed to take part"
COPY_REFUSED = "Did not agree to take part"
COPY_WHEN = "{when}, version {version} of this information"
COPY_NAME = "Signed: {name}"
COPY_NAME_NOTE = (
    "Your name is on this page alone, and is not kept with the study. Print or save the page now "
    "if you want to keep it."
)
COPY_SIGNED = "Signed on the screen; the name is not kept with the study."
COPY_PRINT = "Print"
COPY_PRINT_NOTE = "To keep this page, print it or save it as PDF with your browser."
CONSENT_CHANGED = "This information has changed since you opened the page. Please read it again."

# Questionnaires
EVERY_QUESTION = "Please answer every question."
MOST_QUESTIONS = "Please answer every question that is not marked as optional."
OPTIONAL = "optional"
PLEASE_ANSWER = "Please answer this question."
MISSING_ONE = "One question still needs an answer:"
MISSING_MANY = "{count} questions still need an answer:"
FOLLOWS_ONE = "Your answers lead to one more question:"
FOLLOWS_MANY = "Your answers lead to {count} more questions:"
QUESTION = "question {number}"
WRONG_WHOLE = "Please enter a whole number from {low} to {high}."
WRONG_NUMBER = "Please enter a number from {low} to {high}."
WRONG_TEXT = "Please write at most {longest} characters of plain text."
WRONG_CHOICE = "Please choose one of the answers."
RANGE = "A number from {low} to {high}"
LONGEST = "At most {longest} characters"
NEXT = "Continue"
BACK = "Back"
FINISH = "Hand in"
SAVING = "Saving …"
SAVED = "All answers are saved."
UNSAVED = "Not saved. Trying again; please leave this page open."
CANNOT_SAVE = "This part is closed, or the page is out of date. Please reload it."

# At the wheel
WHEEL_TITLE = "Please turn to the wheel"
WHEEL_NEXT = "Next comes: {title}."
WHEEL_CALL = "Tell the experimenter that you are ready."
WHEEL_READY = "I am ready"
WHEEL_BEGINS = "When you press the button, the window for driving opens on this screen."
WHEEL_RUNNING = "It is running. Follow what the screen at the wheel says."
WHEEL_BEGUN = (
    "It was begun and is not finished. If the screen at the wheel shows it, go on there; otherwise "
    "tell the experimenter that you are ready."
)
WHEEL_AFTER = "This page moves on by itself when you are done there."
STOPPED_TITLE = "It has stopped"
STOPPED_TEXT = (
    "“{title}” has stopped before its end. What you had finished is kept, and the experimenter is "
    "told on their page. Please wait for them."
)
STOPPED_KIOSK = (
    "“{title}” has stopped before its end. What you had finished is kept. If something is wrong, "
    "please ask the experimenter; otherwise you can go on."
)
COMPUTER_TITLE = "One moment, please"
COMPUTER_TEXT = "The computer prepares the next part. This page moves on by itself."
COMPUTER_BEGUN = (
    "The computer was preparing the next part and has not finished. If this page is still the same "
    "in a few minutes, tell the experimenter."
)
KIOSK_BUSY = "Somebody else is driving on this computer now. Please ask the experimenter."
CHECK_AGAIN = "Look again"
LOST = "The connection is lost. This page tries to reach the computer again."
ENDED = "This page does not follow the study any more. Reload it."

# Short links
SHORT_TITLE = "Welcome to the study"
SHORT_READY = "Press the button to begin, or to go on where you stopped."
SHORT_CODE = "The code that the experimenter gives you"
SHORT_WRONG = (
    "This code is not valid: it works once, for a quarter of an hour. Look whether it is typed "
    "right, or ask the experimenter for a new one."
)

# Ends
THANKS_TITLE = "Thank you"
THANKS_TEXT = "You have finished. Everything is saved; you may close this page."
DECLINED_TITLE = "Thank you for considering it"
DECLINED_TEXT = (
    "You chose not to take part, and nothing more is asked of you. "
    "Please tell the experimenter; you may close this page."
)
TOO_YOUNG_TITLE = "Thank you for your interest"
TOO_YOUNG_TEXT = (
    "This study is for people who are {age} years old or older, so it ends here for you, and "
    "nothing more is asked. Please tell the experimenter; you may close this page."
)
LEFT_TITLE = "Thank you for your time"
LEFT_KEPT = (
    "You have left the study. What you had answered and done by then is kept under a code, without "
    "your name. If you would rather have it erased, tell the experimenter."
)
LEFT_ERASING = "You have left the study. What you had answered and done is being erased."
LEFT_ERASED = (
    "You have left the study. What you had answered and done is erased. Only that somebody took "
    "part under a code, and left, is still on record."
)
LEFT_END = "Nothing more is asked of you. You may close this page."

# What went wrong
EXPIRED_TITLE = "This link is not valid any more"
EXPIRED_TEXT = (
    "It has ended, was replaced by a newer one, or was not copied completely. If you are taking "
    "part, ask the experimenter for a new link: you go on where you stopped."
)
BUSY_TITLE = "The study cannot be reached just now"
BUSY_READ = "Another program is using it. Please wait a moment and try again."
BUSY_SENT = (
    "Another program is using it, so what you sent is not kept yet. It is still on this page: wait "
    "a moment and try again. If this comes again, tell the experimenter, and leave this page open."
)
TRY_AGAIN = "Try again"
TOO_MANY_TITLE = "Too many wrong links"
TOO_MANY_TEXT = "Please wait {seconds} seconds and try again, or ask the experimenter."
TOO_MANY_SIGN_INS = (
    "Please wait {seconds} seconds and try again, or use the sign-in code in the terminal: that "
    "one never waits."
)
TOO_MANY_PAGES = "Too many pages are open. Close some of them and reload this one."
STALE_TITLE = "This page is out of date"
STALE_TEXT = "Nothing was changed. Go back, reload the page and try again."
REFUSED_TITLE = "This request was refused"
REFUSED_ORIGIN = "It did not come from a page of this console. Nothing was changed."
REFUSED_HOST = "This console answers to {hosts} only. Open it by that address."
REFUSED_SIZE = "It holds more than a form of this console can. Nothing was changed."
REFUSED_KIND = "Only a form of this console is read. Nothing was changed."
NOT_FOUND_TITLE = "There is no such page"
NOT_FOUND_TEXT = "Check the address, or ask the experimenter for a new link."
ERROR_TITLE = "Something went wrong"
ERROR_TEXT = (
    "Answers given before are safe. Reload the page; if this comes again, tell the experimenter. "
    "The terminal in which the console runs says more."
)
CANNOT_TITLE = "That cannot be done now"
GO_ON = "Go on"

# Experimenter: frame
CONSOLE = "Experimenter’s console"
PEOPLE = "Participants"
CHECKS = "Checks"
SIGN_OUT = "Sign out"
SIGN_IN_TITLE = "This page is for the experimenter"
SIGN_IN_LINK = (
    "Type the code at the end of the sign-in link that the console printed in its terminal. "
    "Each works once; after that the terminal shows the next one."
)
SIGN_IN_CODE = "Sign-in code"
SIGN_IN_THERE = "Signed in already? Go on in that tab: its address is for this browser alone."
SIGN_IN_PARTICIPANT = "Taking part in the study? Open the link that the experimenter gave you."
SIGN_IN_USED = "That sign-in code was used before, or is not complete."
PASSWORD = "Password"
SIGN_IN = "Sign in"
WRONG_PASSWORD = "That is not the password."

# Experimenter: list
NOBODY = "Nobody is enrolled yet. The first enrolment freezes the protocol."
NOBODY_IN = "Nobody is under way."
OVER_TITLE = "Finished or left ({count})"
ENROL = "Enrol"
ENROL_TRAINING = "Enrol a training participant"
ENROL_TEST = "Enrol a test participant"
ENROL_NOTE = "The program chooses the pseudonym and the order of the conditions."
COLUMN_WHO = "Participant"
COLUMN_STANDING = "Standing"
COLUMN_STEP = "Step"
COLUMN_NEXT = "What to do next"
WRONG_ROLE = "The role is {role!r}; it must be {roles}."
ROLE = {"training": "training", "test": "test"}
STANDING = {
    "enrolled": "enrolled",
    "running": "under way",
    "finished": "finished",
    "declined": "declined",
    "withdrawn, data kept": "withdrawn, data kept",
    "withdrawn, being erased": "withdrawn, being erased",
    "withdrawn, data erased": "withdrawn, data erased",
}
LIVE = "Follows the study by itself."
DESIGN = "Recruiting and orders"
ROLE_NAME = {"training": "Training", "test": "Test"}
RECRUITED = "{role}: {staying} taking part, {finished} of them finished; {left} left."
RECRUITED_OF = (
    "{role}: {staying} of {wanted} taking part, {finished} of them finished; {left} left."
)
DESIGN_ORDER = "Order of the conditions"
DESIGN_STAYING = "Taking part"
DESIGN_FINISHED = "Finished"
DESIGN_LEFT = "Left"
DESIGN_BALANCE = "The place of whoever leaves goes to the next who is enrolled."
DESIGN_BLIND = "The protocol hides from you which condition comes when."
DESIGN_DROP_OUTS = "Who left"
DESIGN_BEFORE = "before the end of “{title}”"
EXPORT = "Data"
EXPORT_FORMATS = {
    "csv": "CSV tables, for R, pandas and spreadsheets",
    "spss": "SPSS files with labels, for SPSS, JASP and jamovi",
    "parquet": "Parquet files with labels, for pandas and R",
    "psych-ds": "A Psych-DS dataset, to publish",
}
EXPORT_WHAT = "In which format?"
EXPORT_DO = "Export data"
EXPORT_NOTE = (
    "Takes up to half a minute, then downloads a .zip with a codebook. Participants are pseudonyms; "
    "who withdrew, your notes and answers in participants’ own words are left out. An erasure "
    "reaches the study’s own copy, not what you downloaded."
)
EXPORT_WRONG = "The format is {format!r}; choose one of {known}."
EXPORT_FAILED = "The export stopped without saying why; see steerlab export in a terminal."

# Experimenter: what to do next
NEXT_LINK = "Make a link, open it on the participant’s tablet and hand it over."
NEXT_PAGE = "Nothing: “{title}” is on the participant’s page."
NEXT_START = "Start “{title}” and ask the participant to the wheel."
NEXT_RESUME = "Resume “{title}”: it was begun and is not finished."
NEXT_RUNNING = "Nothing: “{title}” is running at the wheel."
NEXT_COMPUTING = "Nothing: the computer is at “{title}”."
NEXT_BY_ITSELF = "Nothing: “{title}” begins by itself when the computer is free."
NEXT_STOPPED = "“{title}” has stopped before its end. Look at what it said, then resume it."
NEXT_OTHER_RUNS = "Wait: {participant} is at the wheel."
NEXT_FINISHED = "Nothing: finished."
NEXT_DECLINED = "Nothing: declined to take part."
NEXT_LEFT = "Nothing: withdrawn."
NEXT_ERASING = "Nothing: the data are being erased."
NEXT_ERASE_LATER = "Nothing: the data are erased when nobody is at the wheel any more."
NEXT_ERASE = "Erase the data once more: that was cut off."

# Experimenter: one participant
PERSON_TITLE = "Participant {id}"
KIND_OF = {"training": "Training participant", "test": "Test participant"}
PERSON_NEXT = "What to do next"
START = "Start “{title}”"
RESUME = "Resume “{title}”"
RUN_RUNNING = "“{title}” of {participant} runs since {since}, process {pid}."
RUN_STOPPING = "It was asked to stop. If it does not, stop it at once: the drive under way is lost."
RUN_STOPPED = "“{title}” of {participant} stopped before its end."
RUN_STOPPED_AFTER = "“{title}” of {participant} stopped after {progress}."
RUN_STOP = "Stop “{title}”"
RUN_STOP_NOW = "Stop “{title}” at once"
RUN_DONE = "“{title}” of {participant} ended well."
RUN_FAILED = "“{title}” of {participant} stopped with exit code {code}. Its last lines:"
RUN_BUSY = (
    "“{title}” of {participant} is running, process {pid}. Finish or stop it at the wheel first."
)
RUN_NOT_NEXT = "“{title}” is not what comes next for {participant}. Nothing was started."
RUN_NOT_STARTED = "“{title}” cannot be started: {error}. Close other programs and try again."
ERASING = "Erasing the data"
LINK_TITLE = "Participant’s link"
LINK_NONE = (
    "A link is shown once, when it is made. A new one ends the older ones; "
    "the participant goes on where they stopped."
)
LINK_MAKE = "Make a new link"
LINK_SHOWN = "Open this on the participant’s tablet or in a second browser. It is shown only now."
LINK_LABEL = "Link for {id}"
LINK_SHORT = "Short link, to type: {address}"
LINK_SHORT_NOTE = "It works once, for a quarter of an hour."
LINK_SHORT_CAMERA = "The tablet’s camera reads it from here:"
LINK_SHORT_QR = "The short link as a QR code"
LINK_OPEN = "Open it on this screen"
COPY = "Copy"
COPIED = "Copied"
WAY_TITLE = "Way through the study"
ORDER = "Order of the conditions: {order}"
STATE = {"waiting": "to come", "started": "begun", "done": "done", "skipped": "left out"}
NOW = "now"
REDO = "Redo"
REDO_TEXT = "“{title}” opens again. What was recorded stays in the study and no longer counts."
REDO_DO = "Redo “{title}”"
NOTES_TITLE = "Notes"
NOTES_NONE = "No notes yet."
NOTE_LABEL = "New note; no names or contacts"
NOTE_SAVE = "Keep note"
NOTE_LONG = "The note has {count} characters; keep it to {longest}, or make two of it."
HEALTH_TITLE = "Device and timing"
HEALTH_NONE = "Nothing was recorded at the wheel yet."
REDO_WHICH = "Which drives?"
REDO_ALL = "All of them"
REDO_NONE_CHOSEN = "Choose which drives of “{title}” are done again. Nothing was changed."
REDO_FLAGGED = "{rollout}: {flags}"
REACH_NONE = "Nobody else’s data are touched."
REACH_NETWORK = (
    "The network has learnt from {participant}, so it is removed. A new one needs {needed} training "
    "participants, and {left} are left{then}."
)
REACH_TRAINED = ": it is trained anew, which takes about a minute"
REACH_TOO_FEW = ": there is none until more have finished"
REACH_TESTS = "The w of {count} test participants comes from it, and is found anew: {who}."
REACH_TAUGHT = "What {count} of them have taught with it stays as it happened: {who}."
WITHDRAW_LATER = (
    "{participant} is at the wheel now. Leaving is kept at once; the data are erased when the wheel "
    "is free, as long as the console stays open."
)
WITHDRAW_TITLE = "Withdraw"
WITHDRAW_TEXT = (
    "For a participant who says that they want to leave. Closing a tab is not withdrawing."
)
WITHDRAW_WHAT = "What happens to the data?"
WITHDRAW_KEEP = "Keep what was recorded so far"
WITHDRAW_ERASE = (
    "Erase it: answers, labels and recordings, and the study’s exports and reports, which hold "
    "some of it and can be made anew. This cannot be undone."
)
ERASE_TITLE = "Erase the data"
ERASE_TEXT = "For a participant who has left and now wants their data erased."
ERASE_DO = "Erase the data of this participant"
WITHDRAW_TYPE = "Type {id} to confirm"
WITHDRAW_DO = "Withdraw this participant"
WITHDRAW_CHOOSE = "Choose what happens to the data: keep or erase."
WITHDRAW_MISTYPED = "To confirm, type {id} exactly as it is shown. Nothing was changed."

# Experimenter: checks
CHECKS_TITLE = "Checks of the whole study"
CHECKS_BUSY = "Checking now; this page follows by itself."
CHECKS_AT = "Checked at {at}."
CHECKS_AGAIN = "Check again"
CHECKS_WELL = "Nothing is wrong in {count} checks."
CHECKS_BAD_ONE = "One of {count} checks needs you."
CHECKS_BAD = "{bad} of {count} checks need you."
WELL = "well"
TO_KNOW = "to know"
NEEDS_YOU = "needs you"


class _Spoken(ModuleType):
    """This module: its texts are read in the language that is spoken."""

    def __getattribute__(self, name: str) -> Any:
        value = super().__getattribute__(name)
        return said(value) if name.isupper() else value


sys.modules[__name__].__class__ = _Spoken
