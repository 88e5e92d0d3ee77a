# cmake -DDOCUMENT=... -DPROGRAM=... -P check_document.cmake: the document shows the program as it is.
cmake_minimum_required(VERSION 3.25)
file(READ ${DOCUMENT} document)
file(READ ${PROGRAM} program)
string(FIND "${document}" "```c\n${program}```" position)
if(position EQUAL -1)
  message(FATAL_ERROR "${DOCUMENT} does not show ${PROGRAM} as it is")
endif()
