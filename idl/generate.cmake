# cmake -DIDL=... -DDIRECTORY=... -DGENERATOR=program|arguments -P generate.cmake
#
# Runs the generator in DIRECTORY on a copy of the IDL.  Nothing runs when the digest of the last run is still
# true (a fresh checkout changes the time, not the content).  Warnings are errors: idlc's about implicit
# extensibility is the one that would break the wire in silence.  A recursive type keeps idlc busy for ever,
# hence the time limit.
string(REPLACE "|" ";" GENERATOR "${GENERATOR}")
file(SHA256 ${IDL} digest)
set(digest "${digest} ${GENERATOR}")
if(EXISTS ${DIRECTORY}/digest)
  file(READ ${DIRECTORY}/digest last)
  if(last STREQUAL digest)
    file(GLOB outputs ${DIRECTORY}/hamel_v1*)
    file(TOUCH_NOCREATE ${outputs})
    return()
  endif()
endif()

file(REMOVE_RECURSE ${DIRECTORY})
file(MAKE_DIRECTORY ${DIRECTORY})
execute_process(COMMAND ${GENERATOR} ${IDL} WORKING_DIRECTORY ${DIRECTORY} TIMEOUT 120
  RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
if(NOT result EQUAL 0 OR output MATCHES "[Ww]arning|Exception|error:")
  file(REMOVE_RECURSE ${DIRECTORY})
  message(FATAL_ERROR "${GENERATOR} on ${IDL}: ${result}\n${output}")
endif()
file(WRITE ${DIRECTORY}/digest "${digest}")
